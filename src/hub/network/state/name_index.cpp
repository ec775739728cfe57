#include "hub/network/state/name_index.hpp"

namespace gimnet::hub {

using proto::route::NameClaim;
using proto::route::NameState;

bool wins(const NameClaim& claim, const NameClaim& over) {
  if (claim.service.has_value() != over.service.has_value()) return !claim.service;
  // The away node of a hub that was cut off gives way to the one that the program is elsewhere.
  const bool away = claim.state == NameState::away;
  if (away != (over.state == NameState::away)) return !away;
  if (claim.rank != over.rank) return claim.rank > over.rank;
  return claim.node < over.node;
}

std::optional<NameIndex::Place> NameIndex::find(std::string_view name, HubId hub) const {
  const auto found = claims_.find(KeyView{name, hub});
  return found == claims_.end() ? std::nullopt : std::optional{found};
}

std::optional<NameIndex::Place> NameIndex::holder(const NameClaim& claim) const {
  const auto in = [](const auto& index, auto id) {
    const auto found = index.find(id);
    return found == index.end() ? std::nullopt : std::optional{found->second};
  };
  return claim.service ? in(groups_, claim.service->group) : in(nodes_, claim.node);
}

std::vector<NameIndex::Place> NameIndex::live_of(HubId hub) const {
  std::vector<Place> places;
  const auto add = [&places, hub](const auto& index, auto first) {
    for (auto each = index.lower_bound(first); each != index.end() && hub_of(each->first) == hub;
         ++each)
      places.push_back(each->second);
  };
  add(nodes_, make_id<NodeId>(hub, 0));
  add(groups_, make_id<GroupId>(hub, 0));
  return places;
}

NameIndex::Place NameIndex::put(std::string_view name, HubId hub, const NameClaim& claim) {
  auto place = claims_.find(KeyView{name, hub});
  Counts& counts = counts_[hub];
  if (place == claims_.end()) {
    place = claims_.try_emplace(Key{std::string{name}, hub}).first;
    bytes_ += count_of(name);
    counts.bytes += count_of(name);
  } else {
    forget_id(*place);
  }
  place->second = claim;
  if (claim.state == NameState::deleted) return place;
  if (claim.service) {
    groups_[claim.service->group] = place;
    ++counts.services;
  } else {
    nodes_[claim.node] = place;
    ++counts.nodes;
  }
  return place;
}

void NameIndex::erase(Place place) {
  forget_id(*place);
  const auto counts = counts_.find(place->first.hub);
  bytes_ -= count_of(place->first.name);
  counts->second.bytes -= count_of(place->first.name);
  if (counts->second.bytes == 0) counts_.erase(counts);
  claims_.erase(place);
}

void NameIndex::forget_id(const Claims::value_type& entry) {
  const auto& [key, claim] = entry;
  if (claim.state == NameState::deleted) return;
  Counts& counts = counts_.at(key.hub);
  if (claim.service) {
    groups_.erase(claim.service->group);
    --counts.services;
  } else {
    nodes_.erase(claim.node);
    --counts.nodes;
  }
}

}  // namespace gimnet::hub
