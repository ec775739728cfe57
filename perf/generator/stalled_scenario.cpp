#include <algorithm>

#include "generator/flood.hpp"
#include "generator/process.hpp"
#include "generator/scenario.hpp"

namespace gimnet::perf {
namespace {

/// Less than a lane of the hub holds: the healthy one loses nothing even while its process is not
/// scheduled.
constexpr std::size_t kWindowBytes = 1024 * 1024;
/// Alone and beside a stalled one in turns, so that neither has the earlier, colder time to itself.
constexpr int kTurns = 2;
/// Not measured: after the start, and after the stalled one came or went.
constexpr std::chrono::milliseconds kSettling{100};

/// What all phases of one sort give together.
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
        flood_(engine, publishers_of(engine, options), 1) {
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
  static std::vector<Publisher> publishers_of(Engine& engine, const RunOptions& options) {
    std::vector<Publisher> publishers;
    publishers.emplace_back(engine.wire(), engine.client(0),
                            std::vector{Target{.kind = Target::Kind::group, .recipients = {}}},
                            MessageShape{.payload_bytes = options.payload_bytes}, Writing::batched);
    return publishers;
  }

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
  engine.open_publisher(engine.client(0));
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
