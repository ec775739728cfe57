#include "proto/control/ctrl_network.hpp"
#include "tests/sim/hubs/world.hpp"

// The faults of a world, until it is left alone.

namespace gimnet::sim::hubs {
namespace {

namespace ctrl = proto::ctrl;

constexpr std::uint64_t kKindsOfWires = 5;
constexpr std::uint64_t kKindsOfChanges = 2;
constexpr std::uint64_t kKindsOfMachines = 6;
constexpr std::uint64_t kKindsOfNodes = 2;
constexpr std::uint64_t kKinds = kKindsOfWires + kKindsOfChanges + kKindsOfMachines + kKindsOfNodes;
constexpr std::uint64_t kStallMost = 900;
constexpr std::uint64_t kOutageMost = 4'000;

}  // namespace

void World::fault() {
  std::uint64_t kind = random_.below(kKinds);
  // Each world has some kinds only, so that they are seen alone, too.
  if ((plan_.kinds >> kind & 1) == 0) return;
  if (kind < kKindsOfWires) return fault_of_a_wire(kind);
  kind -= kKindsOfWires;
  if (kind < kKindsOfChanges) return change_a_wire(kind);
  kind -= kKindsOfChanges;
  if (kind < kKindsOfMachines) return fault_of_a_machine(kind);
  if (nodes_.empty()) return;
  SimNode& node = random_.pick(nodes_);
  if (kind == kKindsOfMachines) return node.crash(now_);
  if (node.plan().moves() && node.is_up()) node.move(now_);
}

void World::fault_of_a_wire(std::uint64_t kind) {
  if (wires_.empty()) return;
  const auto wire = static_cast<std::size_t>(random_.below(wires_.size()));
  const std::uint64_t stall = random_.between(100, kStallMost);
  const std::uint64_t outage = random_.between(100, kOutageMost);
  switch (kind) {
    case 0:
      census_.note(Event::stalled);
      return cut_for(wire, true, true, stall);
    case 1:
      return reset(wire);
    case 2:
      census_.note(Event::cut);
      return cut_for(wire, true, true, outage);
    case 3: {
      census_.note(Event::one_way);
      const bool there = random_.chance(500);
      return cut_for(wire, there, !there, outage);
    }
    default:
      return partition();
  }
}

/// By an administrator.
void World::change_a_wire(std::uint64_t kind) {
  if (wires_.empty()) return;
  const auto index = static_cast<std::size_t>(random_.below(wires_.size()));
  Wire& wire = wires_[index];
  SimNode& person = operators_[wire.plan.dialler];
  const auto cost = static_cast<std::uint16_t>(random_.between(1, 30));
  if (!person.is_up() || hub(wire.plan.dialler) == nullptr) return;
  const hub::DialledLink link = link_of(index);
  if (kind == 0) {
    census_.note(Event::other_cost);
    wire.plan.cost = cost;
    if (wire.wanted) person.command(ctrl::SetLinkCost{link.name, cost});
  } else if (wire.wanted) {
    census_.note(Event::link_removed);
    wire.wanted = false;
    person.command(ctrl::LinkRemove{link.name});
  } else if (find_link(index, 0) == nullptr) {  // otherwise it is being removed, and keeps its name
    census_.note(Event::link_added);
    wire.wanted = true;
    person.command(ctrl::LinkAdd{link.address.url(), link.name, wire.plan.cost});
  }
  note("wire " + std::to_string(index) + " is changed");
}

void World::fault_of_a_machine(std::uint64_t kind) {
  const auto index = static_cast<std::size_t>(random_.below(machines_.size()));
  const std::uint64_t outage = random_.below(random_.chance(500) ? 100 : kOutageMost);
  const std::uint64_t unique = random_.next();
  const auto hour = static_cast<std::int64_t>(3'600'000'000'000);
  const bool back = random_.chance(500);
  Machine& machine = machines_[index];
  if (machine.hub == nullptr || machine.stopped) return;
  switch (kind) {
    case 0:
      census_.note(Event::stopped);
      machine.stopped = true;
      return after_ms(outage, [this, index] { machines_[index].stopped = false; });
    case 1:
      census_.note(Event::drained);
      return machine.hub->drain();
    case 2:
      census_.note(Event::clock_jump);
      machine.plan.wall_ns += back ? -hour : hour;
      return;
    case 3:
      census_.note(Event::lost_power);
      for (const auto& line : lines_) {
        const WirePlan& wire = wires_[line->wire].plan;
        line->dead = line->dead || wire.dialler == index || wire.acceptor == index;
      }
      machine.dark = true;
      break;
    case 4:
      census_.note(Event::lost_state);
      machine.disk = new_disk(unique);
      break;
    default:
      census_.note(Event::killed);
      break;
  }
  stop(index);
  after_ms(outage, [this, index] { start(index); });
}

void World::cut_for(std::size_t wire, bool there, bool back, std::uint64_t ms) {
  note("wire " + std::to_string(wire) + " is cut for " + std::to_string(ms) + " ms");
  wires_[wire].cut = {there, back};
  after_ms(ms, [this, wire] { wires_[wire].cut = {}; });
}

/// Both ends are told, or one.
void World::reset(std::size_t wire) { reset(wire, random_.between(1, 3)); }

void World::reset(std::size_t wire, std::uint64_t ends) {
  census_.note(Event::reset);
  note("wire " + std::to_string(wire) + " is reset");
  for (const auto& line : lines_) {
    if (line->wire != wire || line->stream != nullptr || line->dead) continue;
    line->dead = true;
    if ((ends & 1) != 0) line->peers[0].reset();
    if ((ends & 2) != 0) line->peers[1].reset();
  }
}

void World::partition() {
  census_.note(Event::partition);
  std::vector<bool> side;
  for (std::size_t hub = 0; hub < machines_.size(); ++hub) side.push_back(random_.chance(500));
  const std::uint64_t outage = random_.between(500, kOutageMost);
  for (std::size_t wire = 0; wire < wires_.size(); ++wire) {
    const WirePlan& plan = wires_[wire].plan;
    if (side[plan.dialler] != side[plan.acceptor]) cut_for(wire, true, true, outage);
  }
}

void World::heal() {
  faults_ = false;
  note("the faults are over");
  for (std::size_t hub = 0; hub < machines_.size(); ++hub) {
    machines_[hub].stopped = false;
    start(hub);
  }
  for (Wire& wire : wires_) wire.cut = {};
}

}  // namespace gimnet::sim::hubs
