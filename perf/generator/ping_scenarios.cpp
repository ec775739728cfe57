#include <algorithm>
#include <cstdint>
#include <optional>

#include "generator/flood.hpp"
#include "generator/process.hpp"
#include "generator/scenario.hpp"

namespace gimnet::perf {
namespace {

constexpr std::chrono::milliseconds kPatience{100};
constexpr std::size_t kWarmUpCount = 100;
constexpr std::size_t kBulkBytes = 64 * 1024;
constexpr std::uint8_t kRealTimeLane = 0;
constexpr std::uint8_t kBulkLane = 2;
constexpr StreamId kThere = 1;
constexpr StreamId kBack = 2;
constexpr StreamId kBulk = 3;

/// Clients 0 and 1, of which 1 sends a message back for each that it gets; beside them, perhaps, a
/// flood of bulk.
class PingPair {
 public:
  PingPair(Engine& engine, std::size_t payload_bytes)
      : engine_(engine),
        near_(engine.client(0)),
        far_(engine.client(1)),
        there_(engine.wire(), near_, {Target{.recipients = {&far_}, .stream = kThere}},
               shape(payload_bytes), Writing::unbatched),
        back_(engine.wire(), far_, {Target{.recipients = {&near_}, .stream = kBack}},
              shape(payload_bytes), Writing::unbatched) {
    far_.inbox.expect(kThere, payload_bytes);
    near_.inbox.expect(kBack, payload_bytes);
  }

  void add_bulk() {
    engine_.client(3).inbox.expect(kBulk, kBulkBytes);
    std::vector<Publisher> publishers;
    publishers.emplace_back(
        engine_.wire(), engine_.client(2),
        std::vector{Target{.recipients = {&engine_.client(3)}, .stream = kBulk}},
        MessageShape{.payload_bytes = kBulkBytes, .lane = kBulkLane}, Writing::batched);
    bulk_.emplace(engine_, std::move(publishers), 1);
  }

  /// Nothing when the message or the answer was lost.
  [[nodiscard]] std::optional<std::chrono::nanoseconds> round_trip() {
    const auto begin = Clock::now();
    const auto deadline = begin + engine_.patience();
    if (!pass(there_, far_.inbox, deadline) || !pass(back_, near_.inbox, deadline))
      return std::nullopt;
    return Clock::now() - begin;
  }

  /// Reads, and sends bulk, until `time`.
  void wait_until(Clock::time_point time) {
    for (auto now = Clock::now(); now < time; now = Clock::now()) turn(time - now);
  }

  void drain() {
    if (bulk_) bulk_->drain();
  }

  [[nodiscard]] std::uint64_t bulk_delivered() const {
    return bulk_ ? engine_.client(3).inbox.delivered() : 0;
  }

 private:
  static MessageShape shape(std::size_t payload_bytes) {
    return {.payload_bytes = payload_bytes, .lane = kRealTimeLane};
  }

  bool pass(Publisher& publisher, const Inbox& to, Clock::time_point deadline) {
    const std::uint64_t before = to.settled();
    while (publisher.publish(1) == 0) {
      if (Clock::now() > deadline) return false;
      turn(std::chrono::milliseconds(1));
    }
    while (to.settled() == before) {
      if (Clock::now() > deadline) return false;
      turn(kPatience);
    }
    return true;
  }

  void turn(std::chrono::nanoseconds patience) {
    if (!bulk_) {
      engine_.poll(patience);
      return;
    }
    const std::uint64_t before = near_.inbox.settled() + far_.inbox.settled();
    bulk_->turn(std::min<std::chrono::nanoseconds>(patience, std::chrono::microseconds(100)));
    bulk_->forget_settled(near_.inbox.settled() + far_.inbox.settled() - before);
  }

  Engine& engine_;
  Client& near_;
  Client& far_;
  Publisher there_;
  Publisher back_;
  std::optional<Flood> bulk_;
};

/// Round trips one after the other, at least `interval` from one beginning to the next.
Findings measure(Engine& engine, const RunOptions& options, PingPair& pair,
                 std::chrono::nanoseconds interval) {
  for (std::size_t count = 0; count < kWarmUpCount; ++count) {
    if (!pair.round_trip()) fail("a ping before the measurement got no answer in time");
  }
  std::vector<std::int64_t> round_trips_ns;
  std::uint64_t lost = 0;
  const std::uint64_t bulk_before = pair.bulk_delivered();
  const auto begin = Clock::now();
  const auto cpu_begin_ns = cpu_time_ns(options.process);
  for (auto next = begin; Clock::now() < begin + options.duration; next += interval) {
    if (interval.count() > 0) pair.wait_until(next);
    if (const auto time = pair.round_trip()) {
      round_trips_ns.push_back(time->count());
    } else {
      ++lost;
    }
  }
  const auto cpu_ns = static_cast<double>(cpu_time_ns(options.process) - cpu_begin_ns);
  const double seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  const auto bulk_bytes = static_cast<double>((pair.bulk_delivered() - bulk_before) * kBulkBytes);
  pair.drain();
  const Engine::Counts counts = engine.counts();
  const auto count = static_cast<double>(round_trips_ns.size());

  Findings findings;
  add_percentiles(findings, round_trips_ns);
  findings.add("messages_per_second", 2 * count / seconds);
  findings.add("messages", 2 * count);
  findings.add("cpu_ns_per_message", cpu_ns / (2 * count));
  if (bulk_bytes > 0) findings.add("bulk_bytes_per_second", bulk_bytes / seconds);
  findings.add("lost", static_cast<double>(lost + counts.lost));
  findings.add("wrong", static_cast<double>(counts.wrong));
  return findings;
}

}  // namespace

Findings ping(Engine& engine, const RunOptions& options) {
  engine.connect(2);
  PingPair pair(engine, options.payload_bytes);
  return measure(engine, options, pair, std::chrono::nanoseconds(0));
}

Findings ping_paced(Engine& engine, const RunOptions& options) {
  engine.connect(2);
  PingPair pair(engine, options.payload_bytes);
  return measure(engine, options, pair, std::chrono::milliseconds(1));
}

Findings ping_under_bulk(Engine& engine, const RunOptions& options) {
  engine.connect(4);
  PingPair pair(engine, options.payload_bytes);
  pair.add_bulk();
  return measure(engine, options, pair, std::chrono::nanoseconds(0));
}

}  // namespace gimnet::perf
