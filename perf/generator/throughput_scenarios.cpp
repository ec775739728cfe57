#include <algorithm>

#include "generator/flood.hpp"
#include "generator/process.hpp"
#include "generator/scenario.hpp"

namespace gimnet::perf {
namespace {

constexpr std::chrono::milliseconds kWarmUp{150};

/// Warms up, then measures from rest to rest, so that the processor time belongs to exactly the
/// messages counted.
Findings measure(Engine& engine, const RunOptions& options, std::vector<Publisher> publishers,
                 std::size_t recipients_a_message = 1) {
  Flood flood(engine, std::move(publishers), recipients_a_message);
  flood.warm_up(std::min<std::chrono::nanoseconds>(kWarmUp, options.duration));
  const Engine::Counts before = engine.counts();
  const auto begin = Clock::now();
  const auto cpu_begin_ns = cpu_time_ns(options.process);
  flood.run_for(options.duration);
  flood.drain();
  const auto cpu_ns = static_cast<double>(cpu_time_ns(options.process) - cpu_begin_ns);
  const double seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  const Engine::Counts after = engine.counts();
  const auto delivered = static_cast<double>(after.delivered - before.delivered);

  Findings findings;
  findings.add("cpu_ns_per_message", cpu_ns / delivered);
  findings.add("messages_per_second", delivered / seconds);
  findings.add("messages", delivered);
  findings.add("cpu_share", cpu_ns / 1e9 / seconds);
  findings.add("lost", static_cast<double>(after.lost + flood.missing()));
  findings.add("wrong", static_cast<double>(after.wrong));
  return findings;
}

/// Client `to` gets messages of `stream`.
Target expecting(Engine& engine, const RunOptions& options, std::size_t to, std::size_t stream) {
  Client& client = engine.client(to);
  client.inbox.expect(static_cast<StreamId>(stream), options.payload_bytes);
  return {.recipients = {&client}, .stream = static_cast<StreamId>(stream)};
}

/// Client `from` sends to the targets in turns.
Publisher publisher_of(Engine& engine, const RunOptions& options, std::size_t from,
                       const std::vector<Target>& targets, Writing writing = Writing::batched) {
  return {engine.wire(), engine.client(from), targets,
          MessageShape{.payload_bytes = options.payload_bytes}, writing};
}

/// One message of client 0 to all others.
Findings to_all(Engine& engine, const RunOptions& options, const Target& target,
                std::size_t recipient_count) {
  for (std::size_t index = 1; index <= recipient_count; ++index)
    static_cast<void>(expecting(engine, options, index, target.stream));
  return measure(engine, options, {publisher_of(engine, options, 0, {target})}, recipient_count);
}

}  // namespace

Findings pairs(Engine& engine, const RunOptions& options, std::size_t pair_count, Writing writing) {
  engine.connect(2 * pair_count);
  std::vector<Publisher> publishers;
  for (std::size_t pair = 0; pair < pair_count; ++pair) {
    const Target target = expecting(engine, options, 2 * pair + 1, pair);
    publishers.push_back(publisher_of(engine, options, 2 * pair, {target}, writing));
  }
  return measure(engine, options, std::move(publishers));
}

Findings in_turns(Engine& engine, const RunOptions& options) {
  constexpr std::size_t kDestinations = 8;
  engine.connect(1 + kDestinations);
  std::vector<Target> targets;
  for (std::size_t index = 1; index <= kDestinations; ++index)
    targets.push_back(expecting(engine, options, index, index));
  return measure(engine, options, {publisher_of(engine, options, 0, targets)});
}

Findings fan_out(Engine& engine, const RunOptions& options, std::size_t subscriber_count) {
  engine.connect(1 + subscriber_count);
  engine.join_group(1, subscriber_count);
  return to_all(engine, options, {.kind = Target::Kind::group, .recipients = {}}, subscriber_count);
}

Findings list_100(Engine& engine, const RunOptions& options) {
  constexpr std::size_t kRecipients = 100;
  engine.connect(1 + kRecipients);
  Target target{.kind = Target::Kind::list, .recipients = {}};
  for (std::size_t index = 1; index <= kRecipients; ++index)
    target.recipients.push_back(&engine.client(index));
  return to_all(engine, options, target, kRecipients);
}

namespace {

/// A window below the size of a lane: the healthy one loses nothing even while its process is not
/// scheduled.
constexpr std::size_t kWindowBytes = 1024 * 1024;
/// Alone and beside a stalled one in turns, so that neither has the earlier, colder time to itself.
constexpr int kTurns = 2;
/// Not measured: after the start, and after the stalled one came or went.
constexpr std::chrono::milliseconds kSettling{100};

/// The phases of one sort together.
struct Phases {
  double seconds = 0;
  double delivered = 0;
  double cpu_ns = 0;
  std::chrono::nanoseconds longest_pause{0};  ///< of the publisher, between two writes

  [[nodiscard]] double messages_per_second() const { return delivered / seconds; }
};

class Stalling {
 public:
  Stalling(Engine& engine, const RunOptions& options)
      : engine_(engine),
        options_(options),
        phase_(options.duration / (2 * kTurns)),
        flood_(
            engine,
            {publisher_of(engine, options, 0, {{.kind = Target::Kind::group, .recipients = {}}})},
            1) {
    flood_.set_window(kWindowBytes);
    settle();
  }

  void run_phase(Phases& phases) {
    const std::uint64_t before = healthy().delivered();
    const auto begin = Clock::now();
    const auto cpu_begin_ns = cpu_time_ns(options_.process);
    static_cast<void>(flood_.take_longest_pause());
    flood_.run_for(phase_);
    flood_.drain();
    phases.cpu_ns += static_cast<double>(cpu_time_ns(options_.process) - cpu_begin_ns);
    phases.seconds += std::chrono::duration<double>(Clock::now() - begin).count();
    phases.delivered += static_cast<double>(healthy().delivered() - before);
    phases.longest_pause = std::max(phases.longest_pause, flood_.take_longest_pause());
  }

  /// A new client that subscribes and does not read.
  Client& stall() {
    engine_.connect(1);
    const std::size_t index = engine_.client_count() - 1;
    engine_.join_group(index, 1);
    engine_.stop_reading(engine_.client(index));
    engine_.tolerate_closing(true);
    return engine_.client(index);
  }

  void leave(Client& stalled) {
    engine_.close(stalled);
    engine_.tolerate_closing(false);
    settle();
  }

  [[nodiscard]] const Inbox& healthy() { return engine_.client(1).inbox; }
  [[nodiscard]] std::uint64_t missing() const { return flood_.missing(); }

 private:
  void settle() {
    flood_.run_for(std::min<std::chrono::nanoseconds>(phase_, kSettling));
    flood_.drain();
  }

  Engine& engine_;
  const RunOptions& options_;
  const std::chrono::nanoseconds phase_;
  Flood flood_;
};

}  // namespace

/// Client 0 publishes at line rate to client 1, which reads: alone, and beside a third one that
/// does not, in turns.
Findings stalled_subscriber(Engine& engine, const RunOptions& options) {
  engine.connect(2);
  engine.join_group(1, 1);
  engine.client(1).inbox.expect(0, options.payload_bytes);
  Stalling stalling(engine, options);
  Phases alone;
  Phases beside;
  std::int64_t growth_bytes = 0;
  for (int turn = 0; turn < kTurns; ++turn) {
    stalling.run_phase(alone);
    const auto resident_before = resident_bytes(options.process);
    Client& stalled = stalling.stall();
    stalling.run_phase(beside);
    growth_bytes = std::max(growth_bytes, resident_bytes(options.process) - resident_before);
    stalling.leave(stalled);
  }

  Findings findings;
  findings.add("cpu_ns_per_message", beside.cpu_ns / beside.delivered);
  findings.add("messages_per_second", beside.messages_per_second());
  findings.add("messages_per_second_alone", alone.messages_per_second());
  findings.add("rate_kept", beside.messages_per_second() / alone.messages_per_second());
  findings.add("publisher_pause_ms",
               std::chrono::duration<double, std::milli>(beside.longest_pause).count());
  findings.add("publisher_pause_ms_alone",
               std::chrono::duration<double, std::milli>(alone.longest_pause).count());
  findings.add("rss_growth_bytes", static_cast<double>(growth_bytes));
  findings.add("lost", static_cast<double>(stalling.healthy().lost() + stalling.missing()));
  findings.add("wrong", static_cast<double>(stalling.healthy().wrong()));
  return findings;
}

}  // namespace gimnet::perf
