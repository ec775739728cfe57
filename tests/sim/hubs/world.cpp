#include "tests/sim/hubs/world.hpp"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <utility>

#include "tests/sim/hubs/scenes.hpp"

namespace gimnet::sim::hubs {
namespace {

constexpr milliseconds kFaultsEnd{8'000};
constexpr milliseconds kSettled{6'000};
/// A hub that may be a copy waits 10 s; so long is the longest time that a link is damped.
constexpr milliseconds kWaits{12'000};
constexpr milliseconds kLookEvery{100};
/// A clock of the hubs that never shows 0.
constexpr milliseconds kBegin{1'000};
constexpr std::int64_t kNsPerMs = 1'000'000;

}  // namespace

World::World(const Options& options)
    : options_(options),
      random_(options.seed),
      plan_(options.scene != nullptr ? options.scene->plan() : draw_plan(random_, options.size)) {
  for (const HubPlan& each : plan_.hubs) {
    Machine machine;
    machine.plan = each;
    machine.disk = new_disk(each.unique);
    machines_.push_back(std::move(machine));
  }
  if (plan_.collisions) census_.note(plan_.copied ? Event::copied_state : Event::id_collision);
  for (const WirePlan& each : plan_.wires) wires_.push_back({each, {}, true, 0, {}});
  const SimNode::Around around{random_, book_, census_};
  for (const NodePlan& each : plan_.nodes) nodes_.emplace_back(around, each, false);
  for (std::size_t hub = 0; hub < machines_.size(); ++hub)
    operators_.emplace_back(around, NodePlan{hub, hub, "operator" + std::to_string(hub), 0}, true);
}

/// Of a hub that has no state.
hub::HubState World::new_disk(std::uint64_t unique) {
  hub::HubState disk;
  std::memcpy(disk.unique_id.data(), &unique, sizeof unique);
  for (std::byte& each : disk.secret) each = static_cast<std::byte>(random_.below(256));
  // A hub that lost its state takes a random place, and hardly ever one that it had before
  // (hub/config/state_folder.cpp). Here it takes one behind all that any hub was granted.
  for (const Machine& each : machines_)
    disk.node_mark = std::max({disk.node_mark, each.disk.node_mark, each.disk.group_mark});
  disk.group_mark = disk.node_mark += hub::IndexPool::kBlock;
  return disk;
}

std::string World::words() const {
  const std::string scene =
      options_.scene == nullptr ? std::string{} : std::string{options_.scene->name} + ", ";
  return scene + std::to_string(machines_.size()) + " hubs, " + std::to_string(wires_.size()) +
         " links, " + std::to_string(nodes_.size()) + " nodes, " + std::to_string(plan_.faults) +
         " faults, at " + std::to_string(now_.count()) + " ms";
}

void World::note_plan() const {
  for (const HubPlan& each : plan_.hubs)
    note("hub id " + std::to_string(each.hub) + (each.configured ? "" : ", drawn") +
         (each.collides ? ", of another one, too" : ""));
  for (const WirePlan& each : plan_.wires)
    note("wire from hub " + std::to_string(each.dialler) + " to " + std::to_string(each.acceptor) +
         ", cost " + std::to_string(each.cost) + ", " + std::to_string(each.delay_ms) + " ms, " +
         std::to_string(each.bytes_per_ms) + " bytes a ms");
  for (const NodePlan& each : plan_.nodes)
    note("node " + each.name + " at hub " + std::to_string(each.hub) + " reads " +
         std::to_string(each.reads_per_ms) + " bytes a ms");
}

std::optional<Broken> World::run() {
  now_ = kBegin;
  if (options_.print) note_plan();
  for (std::size_t hub = 0; hub < machines_.size(); ++hub)
    after_ms(random_.below(500), [this, hub] { start(hub); });
  for (std::uint64_t i = 0; i < plan_.faults && options_.scene == nullptr; ++i)
    after_ms(1'000 + random_.below(6'000), [this] { fault(); });
  try {
    if (options_.scene != nullptr) {
      Stage stage(*this);
      options_.scene->play(stage);
    } else {
      run_until(kFaultsEnd);
    }
    heal();
    run_until(now_ + kSettled);
    if (Settled::waits(*this)) run_until(now_ + kWaits);
    Settled(*this).check();
  } catch (const Broken& failure) {
    return failure;
  }
  return std::nullopt;
}

void World::run_until(milliseconds end) {
  while (now_ < end) step();
}

void World::step() {
  now_ += milliseconds{1};
  while (agenda_.step(now_)) {
  }
  for (std::size_t i = 0; i < lines_.size(); ++i) carry(*lines_[i]);
  std::erase_if(lines_, [this](const auto& line) { return is_over(*line); });
  for (SimNode& node : nodes_) node.step(hub(node.at()), now_, faults_ ? plan_.say_every : 0);
  for (SimNode& node : operators_) node.step(hub(node.plan().hub), now_, 0);
  // Another one begins each time.
  const std::size_t first = static_cast<std::size_t>(now_.count()) % machines_.size();
  for (std::size_t i = 0; i < machines_.size(); ++i) {
    const std::size_t machine = (first + i) % machines_.size();
    SimHub* const each = hub(machine);
    if (each == nullptr) continue;
    each->step(now_);
    if (!each->drained()) continue;
    if (const auto redrawn = each->redrawn()) {
      machines_[machine].plan.hub = redrawn->value();
      machines_[machine].redrawn = true;
      ++redraws_;
    }
    stop(machine);
    after_ms(random_.below(500), [this, machine] { start(machine); });
  }
  if (now_ % kLookEvery == milliseconds{0}) check_bounds();
}

/// Bytes of data that may wait for one node or link. BLOCK has half of the lane, and what comes
/// until its senders heed PAUSE; the rest has the lane (docs/protocol.md, section 5).
std::uint64_t World::most_waiting() const {
  const hub::Limits& limits = plan_.limits;
  return limits.lane1_bytes * 3 / 2 + limits.turn_bytes +
         std::max(8 * limits.reserve_bytes, limits.budget_bytes / 8);
}

void World::check_bounds() {
  for (const Machine& machine : machines_) {
    if (machine.hub == nullptr) continue;
    const hub::ShardCounters& counters = machine.hub->counters();
    std::uint64_t dropped = 0;
    for (const hub::Counter& reason : counters.dropped) dropped += reason.value();
    if (counters.accepted.value() + counters.copies.value() !=
        counters.delivered.value() + dropped + counters.queued.value())
      broken(Checker::ledgers,
             "the ledger of hub " + std::to_string(machine.plan.hub) + " is not exact");
    for (const auto& connection : machine.hub->shard().connections)
      if (connection != nullptr && connection->outbox.stale_bytes() > most_waiting())
        broken(Checker::bounded, "more waits for a connection than may");
    // One for each unique id and each hub id that a hub had, and for each link and its dialler's.
    const std::size_t records_most =
        machines_.size() + redraws_ + static_cast<std::size_t>(plan_.faults);
    const std::size_t links_most = 2 * wires_.size() * (1 + static_cast<std::size_t>(plan_.faults));
    if (machine.hub->links().network().store().records().size() > records_most)
      broken(Checker::bounded, "a hub has more records than there were hubs");
    if (machine.hub->links().all().size() > links_most)
      broken(Checker::bounded, "a hub has more links than were dialled");
  }
}

SimHub::Setup World::setup_of(std::size_t machine) {
  Machine& each = machines_[machine];
  const std::int64_t wall = each.plan.wall_ns + now_.count() * kNsPerMs;
  Result<hub::HubStart> start = hub::next_start(each.disk, milliseconds{wall / kNsPerMs});
  if (!start) broken(Checker::bounded, "a hub cannot start again");
  each.disk = start->state;
  SimHub::Setup setup;
  setup.start = *start;
  setup.limits = plan_.limits;
  setup.facts.id = HubId{each.plan.hub};
  setup.facts.id_configured = each.plan.configured;
  setup.facts.redrawn = std::exchange(each.redrawn, false);
  std::memcpy(setup.facts.unique.bytes.data(), each.disk.unique_id.data(),
              setup.facts.unique.bytes.size());
  setup.facts.instance = proto::HubInstance{random_.next()};
  setup.facts.insecure = true;
  setup.facts.name = "hub" + std::to_string(machine);
  setup.facts.version = "1";
  setup.facts.started = now_;
  setup.links.accept = true;
  for (std::size_t wire = 0; wire < wires_.size(); ++wire) {
    if (!wires_[wire].wanted || wires_[wire].plan.dialler != machine) continue;
    setup.links.dial.push_back(link_of(wire));
    setup.links.dial.back().cost = wires_[wire].plan.cost;
    const std::uint32_t silent_ms = wires_[wire].plan.silent_ms;
    if (silent_ms != 0) setup.links.dial.back().terms = {silent_ms / 4, silent_ms, {}};
  }
  return setup;
}

void World::start(std::size_t machine) {
  Machine& each = machines_[machine];
  each.dark = false;
  if (each.hub != nullptr) return;
  ++each.life;
  each.hub = std::make_unique<SimHub>(
      setup_of(machine),
      SimHub::Around{
          [this, machine](hub::LinkNumber number, const hub::DialledLink& to,
                          const proto::Hello& hello) { dial(machine, number, to, hello); },
          [this, machine] { return machines_[machine].plan.wall_ns + now_.count() * kNsPerMs; },
          [this] { return random_.next(); },
          [this, machine](const hub::HubState& state) {
            machines_[machine].disk = state;
            return std::string{};
          }});
  note("hub " + std::to_string(machine) + " starts");
}

void World::stop(std::size_t machine) {
  Machine& each = machines_[machine];
  ++each.life;
  each.stopped = false;
  each.hub.reset();
  note("hub " + std::to_string(machine) + " ends");
}

void World::note(const std::string& words) const {
  if (options_.print)
    std::printf("%8lld ms  %s\n", static_cast<long long>(now_.count()), words.c_str());
}

}  // namespace gimnet::sim::hubs
