#include <algorithm>

#include "tests/sim/hubs/world.hpp"

// Looks at a world that was left alone: links, tables, ways.

namespace gimnet::sim::hubs {
namespace {

/// The pause of a hub that was taken for a copy, and the time to come back.
constexpr milliseconds kCopyWaits{11'000};

std::string words_of(std::size_t from, std::size_t to) {
  return "from hub " + std::to_string(from) + " to " + std::to_string(to);
}

}  // namespace

bool Settled::waits(World& world) {
  if (world.copied_at_ && *world.copied_at_ + kCopyWaits > world.now()) return true;
  for (const Machine& machine : world.machines_) {
    if (machine.hub == nullptr || machine.hub->drains()) return true;
    for (const auto& [number, link] : machine.hub->links().all()) {
      if (link->damped_until()) return true;
    }
  }
  return false;
}

Settled::Settled(World& world) : world_(world) { find_distances(); }

void Settled::check() {
  check_wires();
  check_tables();
  for (std::size_t hub = 0; hub < world_.machines_.size(); ++hub) check_ways(hub);
  check_moves();
  check_groups();
  check_acceptors();
  ask_names();
  send_to_all();
  check_names();
  check_arrivals();
  check_rest();
  check_ledgers();
}

/// Does a link stand at both ends, between these two processes?
bool Settled::has_edge(std::size_t one, std::size_t other) const {
  const auto stands = [](const SimHub& at, const SimHub& to) {
    return std::ranges::any_of(at.links().all(), [&](const auto& each) {
      const hub::HubLink& link = *each.second;
      return link.connected() && at.links().network().is_up(each.first) &&
             link.peer()->instance == to.facts().instance;
    });
  };
  const SimHub& first = *world_.machines_[one].hub;
  const SimHub& second = *world_.machines_[other].hub;
  return one != other && stands(first, second) && stands(second, first);
}

void Settled::find_distances() {
  const std::size_t hubs = world_.machines_.size();
  std::vector<std::vector<std::size_t>> neighbours(hubs);
  for (const Wire& wire : world_.wires_) {
    const std::size_t one = wire.plan.dialler;
    const std::size_t other = wire.plan.acceptor;
    if (!has_edge(one, other)) continue;
    neighbours[one].push_back(other);
    neighbours[other].push_back(one);
  }
  distance_.assign(hubs, std::vector<int>(hubs, -1));
  for (std::size_t from = 0; from < hubs; ++from) {
    std::vector<std::size_t> found{from};
    distance_[from][from] = 0;
    for (std::size_t next = 0; next < found.size(); ++next) {
      for (const std::size_t other : neighbours[found[next]]) {
        if (distance_[from][other] >= 0) continue;
        distance_[from][other] = distance_[from][found[next]] + 1;
        found.push_back(other);
      }
    }
  }
}

void Settled::check_wires() const {
  for (std::size_t index = 0; index < world_.wires_.size(); ++index) {
    const Wire& wire = world_.wires_[index];
    const Machine& dialler = world_.machines_[wire.plan.dialler];
    const Machine& acceptor = world_.machines_[wire.plan.acceptor];
    if (!wire.wanted || &dialler == &acceptor) continue;
    // A hub whose id or state folder another one has may have to stay out.
    if (dialler.plan.collides || acceptor.plan.collides) continue;
    const hub::HubLink* const one = world_.find_link(index, 0);
    const hub::HubLink* const other = world_.find_link(index, 1);
    if (one == nullptr || other == nullptr || !one->connected() || !other->connected())
      broken(Checker::joined, "wire " + std::to_string(index) + " carries no link: " +
                                  (one == nullptr ? "never" : one->last_error));
  }
}

void Settled::check_tables() const {
  for (std::size_t one = 0; one < distance_.size(); ++one) {
    const hub::NetworkState& first = world_.machines_[one].hub->links().network();
    std::size_t reachable = 0;
    for (std::size_t other = 0; other < distance_.size(); ++other) {
      if (distance_[one][other] < 0) continue;
      ++reachable;
      const hub::NetworkState& second = world_.machines_[other].hub->links().network();
      if (!std::ranges::binary_search(first.map().reachable(), second.self().key))
        broken(Checker::equal_tables, "there is no record " + words_of(one, other));
      if (first.digest() != second.digest())
        broken(Checker::equal_tables, "digests differ " + words_of(one, other));
    }
    if (reachable != first.map().reachable().size())
      broken(Checker::equal_tables,
             "hub " + std::to_string(one) + " knows hubs that are not there");
  }
}

/// So many links to that hub. Nothing: the table of some hub on the way names none.
std::optional<int> Settled::follow(std::size_t from, std::size_t to) const {
  const HubId wanted = world_.machines_[to].hub->facts().id;
  int links = 0;
  while (from != to) {
    SimHub& at = *world_.machines_[from].hub;
    const hub::NextHop next = at.routes().find(wanted);
    const hub::Connection* const link =
        next.exists() ? at.shard().find(hub::SessionRef{next.link.slot, next.link.generation})
                      : nullptr;
    if (link == nullptr || !link->connected) return std::nullopt;
    const auto there = std::ranges::find_if(world_.machines_, [&](const Machine& machine) {
      const auto other = static_cast<std::size_t>(&machine - world_.machines_.data());
      return machine.hub->facts().id == hub_of(link->node) && distance_[from][other] > 0;
    });
    if (there == world_.machines_.end() || links > proto::kHopsMax) return std::nullopt;
    from = static_cast<std::size_t>(there - world_.machines_.begin());
    ++links;
  }
  return links;
}

void Settled::check_ways(std::size_t from) const {
  for (std::size_t to = 0; to < distance_.size(); ++to) {
    if (distance_[from][to] <= 0 || distance_[from][to] > proto::kHopsMax) continue;
    const auto links = follow(from, to);
    if (!links) broken(Checker::no_loop, "the next hops do not lead " + words_of(from, to));
    if (*links > proto::kHopsMax)
      broken(Checker::no_loop, "the next hops lead too far " + words_of(from, to));
  }
}

}  // namespace gimnet::sim::hubs
