#include "tests/sim/hubs/scene_plans.hpp"

#include <utility>

namespace gimnet::sim::hubs {
namespace {

constexpr std::int64_t kWallOfScenes = 1'700'000'000'000'000'000;
constexpr std::uint64_t kFaultsMost = 8;  ///< so many restarts, for the bounds

}  // namespace

Plan plan_of(std::size_t hubs) {
  Plan plan;
  plan.faults = kFaultsMost;
  for (std::size_t i = 0; i < hubs; ++i) {
    HubPlan hub;
    hub.hub = static_cast<std::uint16_t>(i + 1);
    hub.unique = (i + 1) * 0x9E37'79B9'7F4A'7C15;
    hub.wall_ns = kWallOfScenes;
    plan.hubs.push_back(hub);
  }
  return plan;
}

void wire(Plan& plan, std::size_t from, std::size_t to, std::uint64_t delay_ms,
          std::uint32_t bytes_per_ms) {
  WirePlan each;
  each.dialler = from;
  each.acceptor = to;
  each.delay_ms = delay_ms;
  each.bytes_per_ms = bytes_per_ms;
  plan.wires.push_back(each);
}

void node(Plan& plan, std::size_t hub, std::string name) {
  NodePlan each;
  each.hub = each.other = hub;
  each.name = name.empty() ? "n" + std::to_string(plan.nodes.size()) : std::move(name);
  plan.nodes.push_back(std::move(each));
}

Plan chain(std::size_t hubs, std::uint64_t delay_ms, std::uint32_t bytes_per_ms) {
  Plan plan = plan_of(hubs);
  for (std::size_t i = 0; i < hubs; ++i) {
    if (i != 0) wire(plan, i - 1, i, delay_ms, bytes_per_ms);
    node(plan, i);
  }
  return plan;
}

Plan ring(std::size_t hubs, std::uint64_t delay_ms, std::uint32_t bytes_per_ms) {
  Plan plan = chain(hubs, delay_ms, bytes_per_ms);
  wire(plan, hubs - 1, 0, delay_ms, bytes_per_ms);
  return plan;
}

Plan star(std::size_t hubs) {
  Plan plan = plan_of(hubs);
  for (std::size_t i = 0; i < hubs; ++i) {
    if (i != 0) wire(plan, i, 0);
    node(plan, i);
  }
  return plan;
}

}  // namespace gimnet::sim::hubs
