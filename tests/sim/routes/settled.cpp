#include <algorithm>
#include <numeric>
#include <set>

#include "tests/sim/routes/world.hpp"

// The checks of a world that was left alone.

namespace gimnet::sim::routes {
namespace {

constexpr std::uint64_t kNoWay = UINT64_MAX / 4;
/// A refused dialler has tried again within this time.
constexpr milliseconds kRetried{1'500};
constexpr milliseconds kRetriedAsCopy{12'000};

}  // namespace

Settled::Settled(World& world) : world_(world), component_(world.hubs_.size()) {
  std::iota(component_.begin(), component_.end(), std::size_t{0});
  for (std::size_t round = 0; round < component_.size(); ++round) {
    for (const Wire& wire : world_.wires_) {
      if (!stands(wire)) continue;
      auto& a = component_[wire.ends[0].hub];
      auto& b = component_[wire.ends[1].hub];
      a = b = std::min(a, b);
    }
  }
}

bool Settled::stands(const Wire& wire) const {
  return wire.ends[0].open && wire.ends[1].open &&
         wire.ends[0].connection == wire.ends[1].connection;
}

void Settled::check() {
  check_wires();
  check_ids();
  find_shortest();
  for (std::size_t hub = 0; hub < world_.hubs_.size(); ++hub) {
    check_tables(hub);
    check_words(hub);
    check_ways(hub);
    check_names(hub);
  }
}

void Settled::check_wires() {
  for (const Wire& wire : world_.wires_) {
    if (wire.wanted == stands(wire) || (wire.wanted && is_explained(wire))) continue;
    if (!wire.wanted && !wire.ends[0].open) continue;
    world_.fail(Checker::joined, "the link between hub " + std::to_string(wire.ends[0].hub) +
                                     " and hub " + std::to_string(wire.ends[1].hub) +
                                     (wire.wanted ? " does not stand" : " stands"));
  }
}

bool Settled::is_explained(const Wire& wire) const {
  // A hub that has just lost its id, or learnt of a copy, is away.
  for (const End& end : wire.ends) {
    if (world_.plan_.has_collisions && !world_.takes_part(end.hub)) return true;
  }
  if (!wire.refusal) return false;
  const auto& [admission, refused, refusing, at] = *wire.refusal;
  const bool copy = admission == hub::LinkAdmission::is_copy;
  if (at + (copy ? kRetriedAsCopy : kRetried) < world_.now()) return false;
  for (std::size_t hub = 0; hub < world_.hubs_.size(); ++hub) {
    if (component_[hub] != component_[refusing]) continue;
    const auto other = world_.identity(hub);
    if (other.instance == refused.instance) continue;
    if (copy && other.key.unique == refused.key.unique) return true;
    // One whose id was drawn draws again.
    if (admission == hub::LinkAdmission::id_taken && other.key.hub == refused.key.hub &&
        refused.configured)
      return true;
  }
  return false;
}

void Settled::check_ids() {
  std::set<std::pair<std::size_t, HubId>> ids;
  for (std::size_t hub = 0; hub < world_.hubs_.size(); ++hub) {
    const HubId id = world_.identity(hub).key.hub;
    if (!ids.emplace(component_[hub], id).second)
      world_.fail(Checker::one_id, "two connected hubs have the id " + std::to_string(id.value()));
  }
}

/// Each hub has of each other one what that one says of itself.
void Settled::check_words(std::size_t hub) {
  for (std::size_t other = 0; other < world_.hubs_.size(); ++other) {
    if (component_[other] != component_[hub]) continue;
    const proto::HubKey key = world_.identity(other).key;
    const hub::StoredRecord* const record = world_.hubs_[hub].state->store().find(key);
    const hub::StoredRecord& own = *world_.hubs_[other].state->store().find(key);
    if (record == nullptr) continue;
    record->each_counting([&](const hub::StoredPart& part) {
      const hub::PartRef said = own.part(part.said.part);
      if (said == nullptr || said->bytes != part.bytes)
        world_.fail(Checker::own_word, "hub " + std::to_string(hub) + " has a record of hub " +
                                           std::to_string(other) + " that is not its own");
    });
  }
}

void Settled::check_tables(std::size_t hub) {
  const auto& state = *world_.hubs_[hub].state;
  std::vector<proto::HubKey> connected;
  for (std::size_t other = 0; other < world_.hubs_.size(); ++other) {
    if (component_[other] == component_[hub]) connected.push_back(world_.identity(other).key);
  }
  std::ranges::sort(connected);
  if (state.map().reachable() != connected) {
    world_.fail(Checker::equal_tables, "hub " + std::to_string(hub) + " reaches " +
                                           std::to_string(state.map().reachable().size()) +
                                           " hubs, and is connected to " +
                                           std::to_string(connected.size()));
  }
  if (state.digest() != world_.hubs_[component_[hub]].state->digest())
    world_.fail(Checker::equal_tables, "hub " + std::to_string(hub) + " has another digest");
}

void Settled::find_shortest() {
  const std::size_t hubs = world_.hubs_.size();
  shortest_.assign(hubs, std::vector<std::uint64_t>(hubs, kNoWay));
  // Each end says the cost of its cheapest link.
  std::vector<std::vector<std::uint64_t>> said = shortest_;
  for (const Wire& wire : world_.wires_) {
    if (!stands(wire)) continue;
    for (const std::size_t end : {std::size_t{0}, std::size_t{1}}) {
      auto& cost = said[wire.ends[end].hub][wire.ends[1 - end].hub];
      const std::uint64_t said_cost =
          wire.ends[end].damped ? hub::LinkCost::kMost : wire.plan.costs[end];
      cost = std::min(cost, said_cost);
    }
  }
  for (std::size_t a = 0; a < hubs; ++a) {
    for (std::size_t b = 0; b < hubs; ++b)
      shortest_[a][b] = a == b ? 0 : std::max(said[a][b], said[b][a]);
  }
  for (std::size_t over = 0; over < hubs; ++over) {
    for (std::size_t a = 0; a < hubs; ++a) {
      for (std::size_t b = 0; b < hubs; ++b)
        shortest_[a][b] = std::min(shortest_[a][b], shortest_[a][over] + shortest_[over][b]);
    }
  }
}

std::optional<std::pair<std::size_t, int>> Settled::follow(std::size_t from, HubId to) const {
  std::size_t at = from;
  for (int hops = 0; hops <= 2 * proto::kHopsMax; ++hops) {
    const auto& state = *world_.hubs_[at].state;
    if (state.self().key.hub == to) return std::pair(at, hops);
    const auto link = state.map().next_hops()[to.value()];
    if (link == hub::LinkNumber{}) return std::nullopt;
    const Wire& wire = world_.wires_[link.value() - 1];
    if (!stands(wire)) return std::nullopt;
    at = wire.ends[0].hub == at ? wire.ends[1].hub : wire.ends[0].hub;
  }
  return std::nullopt;
}

void Settled::check_ways(std::size_t hub) {
  const auto& map = world_.hubs_[hub].state->map();
  for (std::size_t other = 0; other < world_.hubs_.size(); ++other) {
    if (other == hub || component_[other] != component_[hub]) continue;
    const auto key = world_.identity(other).key;
    const std::string pair = std::to_string(hub) + " to " + std::to_string(other);
    const auto way = std::ranges::find(map.ways(), key, &hub::Way::hub);
    if (way == map.ways().end() || way->cost != shortest_[hub][other]) {
      world_.fail(Checker::shortest, "the way from hub " + pair + " is not the shortest one");
      continue;
    }
    const auto found = follow(hub, key.hub);
    const bool too_far = way->hops > 31;
    if (too_far) world_.census_.note(Event::too_far);
    if (too_far ? found.has_value() : (!found || found->first != other || found->second > 31)) {
      world_.fail(Checker::arrives,
                  "a frame from hub " + pair + (too_far ? " goes too far" : " does not arrive"));
    }
  }
}

}  // namespace gimnet::sim::routes
