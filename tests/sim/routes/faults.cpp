#include "tests/sim/routes/world.hpp"

// The faults of a world, until it is left alone.

namespace gimnet::sim::routes {
namespace {

constexpr std::uint64_t kKinds = 12;
constexpr std::uint64_t kFirstKindOfHubs = 9;
constexpr std::uint64_t kOutageMost = 4'000;

}  // namespace

void World::fault() {
  const std::uint64_t kind = random_.below(kKinds);
  // Each world has some kinds only, so that they are seen alone, too.
  if ((plan_.kinds >> kind & 1) == 0) return;
  if (kind >= kFirstKindOfHubs) {
    fault_of_a_hub(kind - kFirstKindOfHubs);
  } else {
    fault_of_a_wire(kind);
  }
}

void World::fault_of_a_wire(std::uint64_t kind) {
  const auto wire = static_cast<std::size_t>(random_.below(wires_.size()));
  Wire& each = wires_[wire];
  End& end = each.ends[static_cast<std::size_t>(random_.below(2))];
  const std::uint64_t outage = random_.below(kOutageMost);
  switch (kind) {
    case 0:  // a reset
      census_.note(Event::reset);
      close(wire, static_cast<int>(random_.below(2)), true);
      break;
    case 1:  // a cut that nobody is told of
      census_.note(Event::cut);
      cut(wire);
      after_ms(outage, [this, wire] { wires_[wire].cut = false; });
      break;
    case 2:  // one message is lost
      end.lose_next = true;
      break;
    case 3:  // another cost
      census_.note(Event::other_cost);
      for (std::uint16_t& cost : each.plan.costs)
        cost = static_cast<std::uint16_t>(random_.between(1, 200));
      for (const End& one : each.ends) {
        if (!one.open) continue;
        hubs_[one.hub].state->set_cost(hub::LinkNumber{static_cast<std::uint32_t>(wire + 1)},
                                       each.plan.costs[&one == &each.ends[0] ? 0 : 1]);
        turn(one.hub);
      }
      break;
    case 4:  // removed, or added again
      each.wanted = !each.wanted;
      if (!each.wanted) close(wire, 0, true);
      census_.note(Event::removed_link);
      break;
    case 5:  // a break that is resumed: what was under way is lost
      if (!each.ends[0].open || !each.ends[1].open || each.cut) break;
      if (each.ends[0].connection != each.ends[1].connection) break;
      census_.note(Event::resumed);
      ++last_number_;
      for (End& one : each.ends) one.connection = last_number_;
      open(wire, 0, last_number_);
      if (each.ends[1].open && each.ends[0].open) open(wire, 1, last_number_);
      break;
    case 6:  // one end says the highest cost, for a while or for good
      census_.note(Event::damped);
      damp(end, wire, true);
      if (random_.chance(500)) {
        after_ms(outage, [this, wire, &end] { damp(end, wire, false); });
      }
      break;
    case 7:
      forge(wire, &end == &each.ends[0] ? 0 : 1);
      break;
    default:
      partition();
      break;
  }
}

/// The hub at that end says of another one what that hub never said.
void World::forge(std::size_t wire, int liar) {
  const End& end = wires_[wire].ends[static_cast<std::size_t>(liar)];
  const auto victim = static_cast<std::size_t>(random_.below(hubs_.size()));
  if (!end.open || victim == end.hub || !hubs_[victim].state) return;
  const hub::StoredRecord* const known = hubs_[end.hub].state->store().find(identity(victim).key);
  if (known == nullptr || known->head() == nullptr) return;
  census_.note(Event::forged_record);
  proto::route::RecordPart part = *known->head();
  if (random_.chance(200)) part.part = static_cast<std::uint16_t>(random_.between(1, 63));
  if (random_.chance(200)) part.instance = proto::HubInstance{random_.next()};
  if (random_.chance(500)) part.neighbours.clear();
  for (auto& each : part.neighbours) each.cost = 1;
  part.sequence += random_.chance(500) ? random_.between(1, 3) : random_.between(1, 1'000);
  pass(wire, 1 - liar, {std::make_shared<const proto::Payload>(proto::encode(part)), 0});
}

void World::damp(End& end, std::size_t wire, bool damped) {
  end.damped = damped;
  if (!end.open) return;
  hubs_[end.hub].state->set_damped(hub::LinkNumber{static_cast<std::uint32_t>(wire + 1)}, damped);
  turn(end.hub);
}

void World::fault_of_a_hub(std::uint64_t kind) {
  const auto hub = static_cast<std::size_t>(random_.below(hubs_.size()));
  if (!hubs_[hub].state) return;
  stop(hub);
  census_.note(kind == 0 ? Event::lost_state : kind == 1 ? Event::outage : Event::restart);
  if (kind == 0) hubs_[hub].plan.unique = random_.next();  // it lost its state
  const std::uint64_t outage = kind == 1 ? random_.below(kOutageMost) : random_.below(100);
  after_ms(outage, [this, hub] { start(hub); });
}

void World::partition() {
  census_.note(Event::partition);
  std::vector<bool> side;
  for (std::size_t hub = 0; hub < hubs_.size(); ++hub) side.push_back(random_.chance(500));
  const std::uint64_t outage = random_.below(kOutageMost);
  for (std::size_t wire = 0; wire < wires_.size(); ++wire) {
    const auto& ends = wires_[wire].ends;
    if (side[ends[0].hub] == side[ends[1].hub]) continue;
    cut(wire);
    after_ms(outage, [this, wire] { wires_[wire].cut = false; });
  }
}

void World::heal() {
  for (std::size_t hub = 0; hub < hubs_.size(); ++hub) start(hub);
  for (Wire& wire : wires_) {
    wire.cut = false;
    for (End& end : wire.ends) end.lose_next = false;
  }
}

}  // namespace gimnet::sim::routes
