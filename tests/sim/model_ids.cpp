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
  const auto look_at =
      [&](GivenIds& ids, const hub::IndexSet& used, const std::vector<std::uint32_t>& given,
          std::set<std::uint32_t>& forgotten, Happening happening, const auto& in_use) {
        bool forgets = false;
        const auto look = [&](std::uint32_t index) {
          if (used.contains(index)) return;
          forgets = true;
          if (!awaiting && !in_use(index)) return;
          broken(Checker::ids, "the index " + std::to_string(index) +
                                   " is not kept as used any more, and somebody " +
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
          [&](std::uint32_t index) {
            return sessions_.contains(index) || rests(resting_ids_, index, now);
          });
  keep_forgettings(state, now);
  look_at(past_.groups, state.groups_used, groups_given_, forgotten_groups_,
          Happening::groups_forgotten, [&](std::uint32_t index) {
            return groups_.contains(index) || rests(resting_groups_, index, now);
          });
}

void Model::keep_forgettings(const hub::HubState& state, milliseconds now) {
  if (state.group_forgettings == past_.group_forgettings) return;
  require(state.group_forgettings == past_.group_forgettings + 1 && now >= past_.returns_until,
          Checker::ids, "groups are forgotten that services may come back to");
  for (const auto& [group, topic] : groups_) {
    require(state.groups_outlasting.contains(group), Checker::ids,
            "a group is forgotten that a service has");
  }
  past_.group_forgettings = state.group_forgettings;
  past_.groups_outlasting = state.groups_outlasting;
}

void Model::give_proof(std::uint32_t group, const std::string& full_name,
                       const std::vector<std::byte>& proof) {
  require(!proof.empty(), Checker::answers, "ADVERTISE is answered without a proof");
  std::vector<GivenProof>& given = past_.proofs[group];
  for (const GivenProof& other : given) {
    if (other.proof != proof) continue;
    return require(other.full_name == full_name && other.forgettings == forgettings_,
                   Checker::answers, "two services have the same proof, or one of them an old one");
  }
  given.push_back({proof, full_name, forgettings_});
}

bool Model::counts(std::uint32_t group, const GivenProof& proof) const {
  const std::uint64_t age = forgettings_ - proof.forgettings;
  return age == 0 || (age == 1 && outlasting_.contains(group));
}

bool Model::is_proven(const std::string& full_name, const proto::ns::Advertise& terms) const {
  const std::uint32_t group = index_of(terms.former_group);
  const auto given = past_.proofs.find(group);
  if (given == past_.proofs.end()) return false;
  return std::ranges::any_of(given->second, [&](const GivenProof& each) {
    return each.proof == terms.former_proof && each.full_name == full_name && counts(group, each);
  });
}

bool Model::is_somebodys(std::uint32_t group) const {
  const auto given = past_.proofs.find(group);
  if (given == past_.proofs.end()) return false;
  return std::ranges::any_of(given->second,
                             [&](const GivenProof& each) { return counts(group, each); });
}

void Model::step_over(bool kept) {
  keeping_failed_ = false;
  if (kept) unkept_.clear();
  // What is answered in a step was decided before anything is kept in it.
  if (forgettings_ != past_.group_forgettings) outlasting_ = past_.groups_outlasting;
  forgettings_ = past_.group_forgettings;
  few_nodes_left_ = past_.nodes.few_left();
  few_groups_left_ = past_.groups.few_left();
}

Past Model::past() const {
  Past past = past_;
  for (const std::uint32_t index : nodes_given_) {
    if (!unkept_.contains(index) && !forgotten_nodes_.contains(index))
      past.nodes.given.insert(index);
  }
  for (const std::uint32_t index : groups_given_) {
    if (!forgotten_groups_.contains(index)) past.groups.given.insert(index);
  }
  return past;
}

}  // namespace gimnet::sim
