#include "tests/sim/routes/world.hpp"

#include <utility>

namespace gimnet::sim::routes {
namespace {

constexpr milliseconds kFaultsEnd{10'000};
constexpr milliseconds kSettled{6'000};
/// For hubs that wait 10 s, twice.
constexpr milliseconds kSettledWithCopies{26'000};
constexpr milliseconds kQuiet{2'000};
constexpr std::uint64_t kRetryAfterVerdict = 250;

proto::UniqueId unique_id(std::uint64_t number) {
  proto::UniqueId unique;
  for (std::size_t i = 0; i < sizeof number; ++i)
    unique.bytes[i] = static_cast<std::uint8_t>(number >> (8 * i));
  return unique;
}

}  // namespace

World::World(std::uint64_t seed) : random_(seed), plan_(draw_plan(random_)) {
  hubs_.resize(plan_.hubs.size());
  for (std::size_t hub = 0; hub < hubs_.size(); ++hub) hubs_[hub].plan = plan_.hubs[hub];
  for (const WirePlan& each : plan_.wires) {
    Wire wire;
    wire.plan = each;
    wire.ends[0].hub = each.dialler;
    wire.ends[1].hub = each.acceptor;
    wires_.push_back(std::move(wire));
  }
}

std::string World::words() const {
  return std::to_string(hubs_.size()) + " hubs, " + std::to_string(wires_.size()) + " links, " +
         std::to_string(plan_.faults) + " faults, at " + std::to_string(now().count()) + " ms";
}

std::optional<Failure> World::run() {
  for (std::size_t hub = 0; hub < hubs_.size(); ++hub)
    after_ms(random_.below(500), [this, hub] { start(hub); });
  for (std::size_t wire = 0; wire < wires_.size(); ++wire) {
    dial_again(wire);
    keep_alive(wire);
  }
  for (std::uint32_t fault = 0; fault < plan_.faults; ++fault)
    after_ms(random_.below(9'000), [this] { this->fault(); });
  for (std::uint32_t change = 0; change < plan_.changes; ++change)
    after_ms(random_.below(9'900), [this] { change_a_name(); });
  agenda_.at(kFaultsEnd, [this] { heal(); });
  const auto run_until = [this](milliseconds end) {
    while (!failure_ && agenda_.step(end)) {
    }
  };
  milliseconds end = kFaultsEnd + kSettled;
  run_until(end);
  if (last_copy_ && *last_copy_ + milliseconds(kRetryOfCopies) > kFaultsEnd) {
    end = kFaultsEnd + kSettledWithCopies;
    run_until(end);
  }
  if (!failure_) Settled(*this).check();
  records_sent_ = 0;
  run_until(end + kQuiet);
  if (records_sent_ != 0)
    fail(Checker::quiet,
         std::to_string(records_sent_) + " records and names were sent though all is settled");
  return failure_;
}

void World::start(std::size_t hub) {
  Hub& each = hubs_[hub];
  if (each.state) return;
  hub::HubIdentity self;
  self.key = {HubId{each.plan.hub}, unique_id(each.plan.unique)};
  self.instance = proto::HubInstance{random_.next()};
  self.configured = each.plan.configured;
  each.state = std::make_unique<hub::NetworkState>(self, hub::HubWords{"hub", "1"});
  start_names(hub);
  each.life = ++last_number_;
  each.away_until = now();
}

void World::stop(std::size_t hub) {
  // A killed process closes its connections; a machine that lost its power does not.
  const bool tell = random_.chance(700);
  for (std::size_t wire = 0; wire < wires_.size(); ++wire) {
    for (const std::size_t end : {std::size_t{0}, std::size_t{1}}) {
      auto& ends = wires_[wire].ends;
      if (ends[end].hub != hub) continue;
      close(wire, static_cast<int>(end), tell);
      // The next process does not know the connection.
      ends[end].connection = std::max(ends[end].connection, ends[1 - end].connection);
      notice_silence(wire);
    }
  }
  hubs_[hub].state.reset();
  hubs_[hub].names.reset();
  hubs_[hub].life = ++last_number_;
}

bool World::takes_part(std::size_t hub) const {
  return hubs_[hub].state != nullptr && now() >= hubs_[hub].away_until;
}

void World::leave(std::size_t hub, bool draw, milliseconds pause) {
  Hub& each = hubs_[hub];
  for (std::size_t wire = 0; wire < wires_.size(); ++wire) {
    for (const int end : {0, 1})
      if (wires_[wire].ends[static_cast<std::size_t>(end)].hub == hub) close(wire, end, true);
  }
  each.state->leave();
  if (draw) {
    const HubId drawn = each.state->draw_hub_id(random_.next());
    each.state->renumber(drawn);
    each.names->renumber(drawn);
    put_names(hub);
    each.plan.hub = drawn.value();
  }
  each.life = ++last_number_;
  each.away_until = now() + pause;
}

void World::turn(std::size_t hub) {
  Hub& each = hubs_[hub];
  if (!each.state) return;
  each.state->advance(now());
  for (const hub::Sending& sending : each.state->take_sendings()) send(hub, sending);
  turn_names(hub);
  const auto verdict = each.state->verdict();
  if (verdict == hub::Verdict::copied) {
    last_copy_ = now();
    census_.note(Event::left_as_copy);
    leave(hub, false, milliseconds(kRetryOfCopies));
  } else if (verdict == hub::Verdict::id_taken) {
    census_.note(Event::left_for_its_id);
    leave(hub, !each.plan.configured, milliseconds(kRetryAfterVerdict + random_.below(250)));
  }
  auto due = each.state->next_due();
  if (const auto of_names = each.names->next_due())
    due = std::min(due.value_or(*of_names), *of_names);
  if (!due || (each.wake && *each.wake <= *due && *each.wake > now())) return;
  const auto at = std::max(*due, now() + milliseconds(1));
  each.wake = at;
  agenda_.at(at, [this, hub] { turn(hub); });
}

void World::send(std::size_t hub, const hub::Sending& sending) {
  const std::size_t wire = sending.link.value() - 1;
  const bool is_record = hub::read_part(*sending.bytes) != nullptr;
  if (is_record) ++records_sent_;
  if (arriving_ != nullptr && arriving_hub_ == hub && arriving_wire_ == wire &&
      *arriving_ == *sending.bytes) {
    fail(Checker::never_back,
         "hub " + std::to_string(hub) + " sends back what came over link " + std::to_string(wire));
  }
  pass(wire, wires_[wire].ends[0].hub == hub ? 1 : 0, {sending.bytes, 0});
}

}  // namespace gimnet::sim::routes
