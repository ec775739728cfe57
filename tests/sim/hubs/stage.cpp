#include "tests/sim/hubs/stage.hpp"

#include "proto/control/ctrl_network.hpp"

namespace gimnet::sim::hubs {

void Stage::run_until_up(std::size_t wire) {
  const auto is_up = [&](std::size_t end) {
    const hub::HubLink* const link = world_.find_link(wire, end);
    const WirePlan& plan = world_.wires_[wire].plan;
    const SimHub* const hub = world_.hub(end == 0 ? plan.dialler : plan.acceptor);
    return link != nullptr && hub != nullptr && hub->links().network().is_up(link->number());
  };
  for (int ms = 0; ms < 10'000 && !(is_up(0) && is_up(1)); ++ms) run(1);
  need(is_up(0) && is_up(1), Checker::joined, "the link does not come up");
}

bool Stage::is_damped(std::size_t wire) const {
  const auto damped = [&](std::size_t end) {
    const hub::HubLink* const link = world_.find_link(wire, end);
    return link != nullptr && link->damped_until().has_value();
  };
  return damped(0) || damped(1);
}

void Stage::spoil_next(std::size_t wire) {
  for (const auto& line : world_.lines_)
    if (line->wire == wire) line->flows[0].spoil_next();
}

void Stage::set_cost(std::size_t wire, std::uint16_t cost) {
  world_.wires_[wire].plan.cost = cost;
  world_.operators_[world_.wires_[wire].plan.dialler].command(
      proto::ctrl::SetLinkCost{World::link_of(wire).name, cost});
}

void Stage::all_arrive(std::uint64_t within_ms) {
  for (std::uint64_t ms = 0; ms < within_ms && arrived() != sent(); ms += 10) run(10);
  need(arrived() == sent(), Checker::reachable, "a frame was lost");
}

void Stage::check_names() {
  Settled settled(world_);
  settled.ask_names();
  run(1'500);
  settled.check_names();
}

}  // namespace gimnet::sim::hubs
