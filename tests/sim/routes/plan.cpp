#include "tests/sim/routes/plan.hpp"

#include <algorithm>

namespace gimnet::sim::routes {
namespace {

constexpr std::size_t kHubsMost = 16;
constexpr std::size_t kChainHubs = 34;
constexpr std::uint16_t kDrawnFrom = 1'024;

void add_wire(Plan& plan, Random& random, std::size_t dialler, std::size_t acceptor) {
  WirePlan wire;
  wire.dialler = dialler;
  wire.acceptor = acceptor;
  wire.name = "wire " + std::to_string(random.below(1'000));
  wire.costs[0] = static_cast<std::uint16_t>(random.between(1, random.chance(500) ? 3 : 100));
  wire.costs[1] = wire.costs[0];
  if (random.chance(100)) wire.costs[1] = static_cast<std::uint16_t>(random.between(1, 100));
  plan.wires.push_back(wire);
}

/// A tree, so that all hubs are connected, and some more links.
void draw_wires(Plan& plan, Random& random) {
  const std::size_t hubs = plan.hubs.size();
  for (std::size_t hub = 1; hub < hubs; ++hub) {
    const auto other = static_cast<std::size_t>(random.below(hub));
    if (random.chance(500)) {
      add_wire(plan, random, hub, other);
    } else {
      add_wire(plan, random, other, hub);
    }
  }
  for (std::uint64_t more = random.below(hubs + 1); more > 0; --more) {
    const auto dialler = static_cast<std::size_t>(random.below(hubs));
    const auto acceptor = static_cast<std::size_t>(random.below(hubs));
    if (dialler != acceptor) add_wire(plan, random, dialler, acceptor);
  }
}

void draw_collision(Plan& plan, Random& random) {
  const auto first = static_cast<std::size_t>(random.below(plan.hubs.size()));
  const auto second = static_cast<std::size_t>(random.below(plan.hubs.size()));
  if (first == second) return;
  plan.has_collisions = true;
  const HubPlan& from = plan.hubs[first];
  HubPlan& to = plan.hubs[second];
  if (random.chance(500)) {
    to = from;  // a copied state folder
  } else {
    to.hub = from.hub;
    to.configured = from.hub < kDrawnFrom || random.chance(500);
  }
}

}  // namespace

Plan draw_plan(Random& random) {
  Plan plan;
  const bool chain = random.chance(30);
  const std::size_t hubs =
      chain ? kChainHubs : static_cast<std::size_t>(random.between(2, kHubsMost));
  for (std::size_t hub = 0; hub < hubs; ++hub) {
    HubPlan each;
    each.configured = random.chance(600);
    each.hub = static_cast<std::uint16_t>(hub + (each.configured ? 1 : kDrawnFrom));
    each.unique = random.next();
    plan.hubs.push_back(each);
  }
  plan.changes = static_cast<std::uint32_t>(random.below(200));
  if (random.chance(500)) plan.grace_ms = random.between(500, 5'000);
  plan.delay_ms = random.chance(300) ? random.between(50, 150) : random.between(1, 20);
  // All copies of many names take more than the time to settle over slow links.
  const bool many = plan.delay_ms < 50 && random.chance(100);
  plan.names = static_cast<std::uint32_t>(many ? 300 : random.below(4));
  if (chain) {
    for (std::size_t hub = 1; hub < hubs; ++hub) add_wire(plan, random, hub - 1, hub);
    return plan;
  }
  draw_wires(plan, random);
  if (random.chance(400)) {
    for (std::uint64_t more = random.between(1, 3); more > 0; --more) draw_collision(plan, random);
  }
  plan.faults = static_cast<std::uint32_t>(random.below(40));
  plan.kinds = static_cast<std::uint32_t>(random.next());
  return plan;
}

}  // namespace gimnet::sim::routes
