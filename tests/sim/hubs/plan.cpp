#include "tests/sim/hubs/plan.hpp"

#include <algorithm>

namespace gimnet::sim::hubs {
namespace {

constexpr std::size_t kChainHubs = 34;
constexpr std::uint16_t kDrawnFrom = 1'024;
constexpr std::int64_t kNow = 1'700'000'000'000'000'000;
constexpr std::uint64_t kSharedNames = 4;
constexpr std::uint64_t kSmallBudget = 8 << 20;

enum class Shape : std::uint8_t { tree, chain, ring, star, mesh, pairs };
constexpr std::size_t kMeshHubsMost = 6;

void add_wire(Plan& plan, Random& random, std::size_t one, std::size_t other) {
  WirePlan wire;
  const bool dials = random.chance(500);
  wire.dialler = dials ? one : other;
  wire.acceptor = dials ? other : one;
  const auto cost = static_cast<std::uint16_t>(random.between(1, 30));
  if (random.chance(600)) wire.cost = cost;
  wire.delay_ms = random.chance(150) ? random.between(20, 50) : random.between(1, 5);
  wire.jitter_ms = random.below(4);
  const auto rate = static_cast<std::uint32_t>(random.between(30, 200));
  if (random.chance(60)) wire.bytes_per_ms = rate;
  plan.wires.push_back(wire);
}

void draw_wires(Plan& plan, Random& random, Shape shape) {
  const std::size_t hubs = plan.hubs.size();
  for (std::size_t hub = 1; hub < hubs; ++hub) {
    std::size_t other = hub - 1;
    if (shape == Shape::star) other = 0;
    if (shape == Shape::tree) other = static_cast<std::size_t>(random.below(hub));
    add_wire(plan, random, other, hub);
    if (shape == Shape::pairs) add_wire(plan, random, other, hub);
    for (std::size_t more = 0; shape == Shape::mesh && more + 1 < hub; ++more)
      add_wire(plan, random, more, hub);
  }
  if (shape == Shape::ring && hubs > 2) add_wire(plan, random, 0, hubs - 1);
  if (shape != Shape::tree) return;
  for (std::uint64_t more = random.below(hubs + 1); more > 0; --more) {
    const auto one = static_cast<std::size_t>(random.below(hubs));
    const auto other = static_cast<std::size_t>(random.below(hubs));
    if (one != other || random.chance(100)) add_wire(plan, random, one, other);
  }
}

/// Two hubs with one id, or from copies of one state folder.
void draw_collision(Plan& plan, Random& random) {
  const auto first = static_cast<std::size_t>(random.below(plan.hubs.size()));
  const auto second = static_cast<std::size_t>(random.below(plan.hubs.size()));
  const bool copied = random.chance(500);
  if (first == second) return;
  HubPlan& from = plan.hubs[first];
  HubPlan& to = plan.hubs[second];
  to.hub = from.hub;
  to.configured = from.configured;
  plan.copied = copied;
  if (copied) to.unique = from.unique;
  from.collides = to.collides = plan.collisions = true;
}

void draw_nodes(Plan& plan, Random& random, const Size& size) {
  const std::uint64_t least = std::min(plan.hubs.size(), size.nodes_most);
  const std::uint64_t nodes = random.between(least, size.nodes_most);
  for (std::uint64_t i = 0; i < nodes; ++i) {
    NodePlan node;
    node.hub = static_cast<std::size_t>(random.below(plan.hubs.size()));
    const auto other = static_cast<std::size_t>(random.below(plan.hubs.size()));
    node.other = random.chance(300) ? other : node.hub;
    const std::uint64_t shared = random.below(kSharedNames);
    node.name = "n" + std::to_string(i);
    if (random.chance(150)) node.name = "shared" + std::to_string(shared);
    const auto reads = static_cast<std::uint32_t>(random.between(300, 2'000));
    if (random.chance(50)) node.reads_per_ms = reads;
    plan.nodes.push_back(node);
  }
}

void draw_limits(Plan& plan, Random& random) {
  plan.limits.grace_ms = random.chance(500) ? random.between(500, 5'000) : 30'000;
  const std::uint64_t lane = random.between(2, 32) * 1'024;
  if (!random.chance(400)) return;
  plan.limits.lane1_bytes = lane;
  plan.limits.reserve_bytes = 4 * lane;
  plan.limits.budget_bytes = kSmallBudget;
}

}  // namespace

Plan draw_plan(Random& random, const Size& size) {
  Plan plan;
  const bool far = size.hubs_most > 4 && random.chance(30);
  const std::size_t hubs =
      far ? kChainHubs : static_cast<std::size_t>(random.between(size.hubs_least, size.hubs_most));
  for (std::size_t hub = 0; hub < hubs; ++hub) {
    HubPlan each;
    each.configured = random.chance(600);
    each.hub = static_cast<std::uint16_t>(hub + (each.configured ? 1 : kDrawnFrom));
    each.unique = random.next();
    const auto off = static_cast<std::int64_t>(random.below(1'000'000'000));
    each.wall_ns = random.chance(100) ? 1'000 : kNow + off;  // a board without a battery
    plan.hubs.push_back(each);
  }
  auto shape = static_cast<Shape>(random.below(6));
  if (shape == Shape::mesh && hubs > kMeshHubsMost) shape = Shape::tree;
  draw_wires(plan, random, far ? Shape::chain : shape);
  draw_nodes(plan, random, size);
  draw_limits(plan, random);
  plan.say_every = random.between(20, 200);
  plan.kinds = random.next();
  const std::uint64_t faults = random.below(30);
  if (!far) plan.faults = faults;
  if (!far && random.chance(150)) draw_collision(plan, random);
  return plan;
}

}  // namespace gimnet::sim::hubs
