#include "tests/sim/model.hpp"

#include <algorithm>

// Which ids the hub may give out: the reference model's part.

namespace gimnet::sim {

bool Model::rests(const std::map<std::uint32_t, milliseconds>& resting, std::uint32_t index,
                  milliseconds now) const {
  const auto found = resting.find(index);
  return found != resting.end() && found->second > now;
}

void Model::take_new_index(std::uint32_t index, milliseconds now) {
  if (sessions_.contains(index)) {
    broken(Checker::ids,
           "a newcomer gets the id of node " + std::to_string(index) + ", which is still a member");
  }
  if (rests(resting_ids_, index, now)) {
    broken(Checker::ids,
           "a newcomer gets the id of node " + std::to_string(index) + ", which rests");
  }
  require(index != kHubIndex && index < kEveryIndex, Checker::ids,
          "a newcomer gets an id that is no node's");
  if (past_.nodes.contains(index)) {
    broken(Checker::ids, "a newcomer gets the id of node " + std::to_string(index) +
                             ", given out before the restart");
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
  GivenIds& ids = past_.nodes;
  const auto in_use = [&](std::uint32_t index) {
    return sessions_.contains(index) || rests(resting_ids_, index, now);
  };
  bool forgets = false;
  const auto look = [&](std::uint32_t index) {
    if (state.nodes_used.contains(index)) return;
    forgets = true;
    if (!awaiting && !in_use(index)) return;
    broken(Checker::ids, "the index " + std::to_string(index) +
                             " is not kept as used any more, and somebody " +
                             (awaiting ? "may come back under it" : "has it"));
  };
  for (std::uint32_t index = 1; index <= ids.old && !forgets; ++index) look(index);
  for (const std::uint32_t index : ids.given) look(index);
  for (const std::uint32_t index : nodes_given_) {
    if (!forgotten_nodes_.contains(index)) look(index);
  }
  if (!forgets) return;
  census_.add(Happening::ids_forgotten);
  ids.old = 0;
  std::erase_if(ids.given, [&](std::uint32_t index) { return !in_use(index); });
  for (const std::uint32_t index : nodes_given_) {
    if (!in_use(index)) forgotten_nodes_.insert(index);
  }
}

void Model::step_over(bool kept) {
  keeping_failed_ = false;
  if (kept) unkept_.clear();
  few_nodes_left_ = past_.nodes.few_left();
}

Past Model::past() const {
  Past past = past_;
  for (const std::uint32_t index : nodes_given_) {
    if (!unkept_.contains(index) && !forgotten_nodes_.contains(index))
      past.nodes.given.insert(index);
  }
  past.groups = {groups_given_.begin(), groups_given_.end()};
  return past;
}

}  // namespace gimnet::sim
