#include "client/nif/hub_clock.hpp"

#include <algorithm>

namespace gimnet::nif {
namespace {

/// The hub's time may be anything: unsigned arithmetic wraps where signed would be undefined.
std::int64_t difference(std::int64_t hub_ns, std::int64_t own_ns) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(hub_ns) -
                                   static_cast<std::uint64_t>(own_ns));
}

std::int64_t sum(std::int64_t time_ns, std::int64_t offset_ns) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(time_ns) +
                                   static_cast<std::uint64_t>(offset_ns));
}

/// Either offset is known to half of its round trip.
bool contradict(const HubClock::Measurement& a, const HubClock::Measurement& b) {
  const auto apart = [&](std::int64_t one, std::int64_t other) {
    const auto between = static_cast<std::uint64_t>(difference(one, other));
    return std::min(between, 0 - between) >
           static_cast<std::uint64_t>(a.round_trip_ns / 2 + b.round_trip_ns / 2 + 1);
  };
  return apart(a.offset_ns, b.offset_ns) || apart(a.steady_offset_ns, b.steady_offset_ns);
}

}  // namespace

proto::flow::Ping HubClock::ping(std::int64_t steady_ns, std::int64_t wall_ns) {
  const MutexLock lock(mutex_);
  if (under_way_.size() >= kUnderWayMax) under_way_.erase(under_way_.begin());
  ++sequence_;
  under_way_.insert_or_assign(sequence_, UnderWay{steady_ns, wall_ns, std::nullopt});
  return {sequence_, wall_ns};
}

void HubClock::on_pong(const proto::flow::Pong& pong, std::int64_t steady_ns) {
  const MutexLock lock(mutex_);
  const auto found = under_way_.find(pong.sequence);
  if (found == under_way_.end() || found->second.answer) return;
  UnderWay& ping = found->second;
  Measurement measured;
  measured.round_trip_ns = steady_ns - ping.steady_ns;
  const std::int64_t half_ns = measured.round_trip_ns / 2;
  measured.offset_ns = difference(pong.now_ns, ping.wall_ns + half_ns);
  measured.steady_offset_ns = difference(pong.now_ns, ping.steady_ns + half_ns);
  ping.answer = measured;
  // A clock was set: what was measured before says nothing any more.
  if (measured_ != 0 && contradict(shortest(), measured)) measured_ = 0;
  kept_[measured_ % kKept] = measured;
  ++measured_;
  steady_offset_ns_ = shortest().steady_offset_ns;
  changed_.notify_all();
}

void HubClock::begin(std::int64_t hub_ns, std::int64_t steady_ns) {
  const MutexLock lock(mutex_);
  steady_offset_ns_ = difference(hub_ns, steady_ns);
}

std::optional<std::int64_t> HubClock::hub_time(std::int64_t steady_ns) {
  const MutexLock lock(mutex_);
  if (!steady_offset_ns_) return std::nullopt;
  return sum(steady_ns, *steady_offset_ns_);
}

std::optional<HubClock::OwnTime> HubClock::own_time(std::int64_t hub_ns) {
  const MutexLock lock(mutex_);
  if (measured_ == 0) return std::nullopt;
  const Measurement& measured = shortest();
  return OwnTime{difference(hub_ns, measured.steady_offset_ns), measured.round_trip_ns / 2};
}

void HubClock::clear() {
  const MutexLock lock(mutex_);
  under_way_.clear();
  measured_ = 0;
  changed_.notify_all();
}

std::optional<HubClock::Measurement> HubClock::wait_for(std::uint32_t sequence, Deadline deadline) {
  const MutexLock lock(mutex_);
  for (;;) {
    const auto found = under_way_.find(sequence);
    if (found == under_way_.end()) return std::nullopt;
    if (found->second.answer) return found->second.answer;
    if (deadline != kNever && steady_now_ns() >= deadline) return std::nullopt;
    static_cast<void>(changed_.wait_until(mutex_, deadline));
  }
}

std::optional<HubClock::Measurement> HubClock::best() {
  const MutexLock lock(mutex_);
  if (measured_ == 0) return std::nullopt;
  Measurement best = shortest();
  best.round_trip_ns = kept_[(measured_ - 1) % kKept].round_trip_ns;
  return best;
}

/// REQUIRES: something was measured.
const HubClock::Measurement& HubClock::shortest() const {
  const auto end =
      kept_.begin() + static_cast<std::ptrdiff_t>(std::min<std::uint64_t>(measured_, kKept));
  return *std::min_element(kept_.begin(), end, [](const auto& a, const auto& b) {
    return a.round_trip_ns < b.round_trip_ns;
  });
}

}  // namespace gimnet::nif
