#include "tests/sim/model.hpp"

// Which ids the hub may give out: the reference model's part.

namespace gimnet::sim {

bool Model::rests(const std::map<std::uint32_t, milliseconds>& resting, std::uint32_t index, milliseconds now) const {
  const auto found = resting.find(index);
  return found != resting.end() && found->second > now;
}

void Model::take_new_index(std::uint32_t index, milliseconds now) {
  if (sessions_.contains(index)) {
    broken(Checker::ids, "a newcomer gets the id of node " + std::to_string(index) + ", which is still a member");
  }
  if (rests(resting_ids_, index, now)) {
    broken(Checker::ids, "a newcomer gets the id of node " + std::to_string(index) + ", which rests");
  }
  require(index != kHubIndex && index < kEveryIndex, Checker::ids, "a newcomer gets an id that is no node's");
  if (past_.nodes.contains(index)) {
    broken(Checker::ids, "a newcomer gets the id of node " + std::to_string(index) + ", given out before the restart");
  }
  if (index > kEveryIndex - 64) census_.add(Happening::index_near_the_end);
}

void Model::give_node(std::uint32_t index, bool granted) {
  nodes_given_.push_back(index);
  forgotten_nodes_.erase(index);
  if (granted) {
    unkept_.erase(index);
  } else {
    unkept_.insert(index);
  }
}

void Model::kept(const hub::HubState& state, milliseconds now) {
  const bool awaiting = now < past_.returns_until;
  const auto look_at = [&](GivenIds& ids, const hub::IndexSet& used, const std::vector<std::uint32_t>& given,
                           std::set<std::uint32_t>& forgotten, Happening happening, const auto& in_use) {
    bool forgets = false;
    const auto look = [&](std::uint32_t index) {
      if (used.contains(index)) return;
      forgets = true;
      if (!awaiting && !in_use(index)) return;
      broken(Checker::ids, "the index " + std::to_string(index) + " is not kept as used any more, and somebody " +
                               (awaiting ? "may come back under it" : "has it"));
    };
    for (std::uint32_t index = 1; index <= ids.old && !forgets; ++index) look(index);
    for (const std::uint32_t index : ids.given) look(index);
    for (const std::uint32_t index : given) {
      if (!forgotten.contains(index)) look(index);
    }
    if (!forgets) return;
    census_.add(happening);
    ids.old = 0;
    std::erase_if(ids.given, [&](std::uint32_t index) { return !in_use(index); });
    for (const std::uint32_t index : given) {
      if (!in_use(index)) forgotten.insert(index);
    }
  };
  look_at(past_.nodes, state.nodes_used, nodes_given_, forgotten_nodes_, Happening::ids_forgotten,
          [&](std::uint32_t index) { return sessions_.contains(index) || rests(resting_ids_, index, now); });
  look_at(past_.groups, state.groups_used, groups_given_, forgotten_groups_, Happening::groups_forgotten,
          [&](std::uint32_t index) { return groups_.contains(index) || rests(resting_groups_, index, now); });
}

void Model::step_over(bool kept) {
  keeping_failed_ = false;
  if (kept) unkept_.clear();
  if (kept) unkept_groups_.clear();
  few_nodes_left_ = past_.nodes.few_left();
  few_groups_left_ = past_.groups.few_left();
}

Past Model::past() const {
  Past past = past_;
  for (const std::uint32_t index : nodes_given_) {
    if (!unkept_.contains(index) && !forgotten_nodes_.contains(index)) past.nodes.given.insert(index);
  }
  for (const std::uint32_t index : groups_given_) {
    if (!unkept_groups_.contains(index) && !forgotten_groups_.contains(index)) past.groups.given.insert(index);
  }
  return past;
}

}  // namespace gimnet::sim
