#include <algorithm>

#include "generator/flood.hpp"
#include "generator/process.hpp"
#include "generator/scenario.hpp"

namespace gimnet::perf {
namespace {

struct Phase {
  double messages_per_second = 0;
  double cpu_ns_per_message = 0;
};

Phase run_phase(Flood& flood, const Inbox& healthy, const RunOptions& options) {
  const std::uint64_t before = healthy.delivered();
  const auto begin = Clock::now();
  const auto cpu_begin_ns = cpu_time_ns(options.process);
  flood.run_for(options.duration);
  flood.drain();
  const auto cpu_ns = static_cast<double>(cpu_time_ns(options.process) - cpu_begin_ns);
  const std::chrono::duration<double> elapsed = Clock::now() - begin;
  const auto delivered = static_cast<double>(healthy.delivered() - before);
  return {.messages_per_second = delivered / elapsed.count(), .cpu_ns_per_message = cpu_ns / delivered};
}

/// Less than a lane of the hub holds: the healthy one loses nothing even while its process is not scheduled.
constexpr std::size_t kWindowBytes = 1024 * 1024;

}  // namespace

/// Client 0 publishes at line rate to client 1, which reads, first alone and then beside client 2, which does not.
Findings stalled_subscriber(Engine& engine, const RunOptions& options) {
  engine.connect(3);
  engine.open_publisher(engine.client(0));
  engine.join_group(1, 1);
  const Inbox& healthy = engine.client(1).inbox;
  engine.client(1).inbox.expect(0, options.payload_bytes);
  std::vector<Publisher> publishers;
  publishers.emplace_back(engine.wire(), engine.client(0),
                          std::vector{Target{.kind = Target::Kind::group, .recipients = {}}},
                          MessageShape{.payload_bytes = options.payload_bytes}, Writing::batched);
  Flood flood(engine, std::move(publishers), 1);
  flood.set_window(kWindowBytes);
  flood.run_for(std::min<std::chrono::nanoseconds>(options.duration, std::chrono::milliseconds(100)));
  flood.drain();
  const Phase alone = run_phase(flood, healthy, options);

  const auto resident_before = resident_bytes(options.process);
  engine.join_group(2, 1);
  engine.stop_reading(engine.client(2));
  engine.tolerate_closing(true);
  const Phase beside = run_phase(flood, healthy, options);

  Findings findings;
  findings.add("cpu_ns_per_message", beside.cpu_ns_per_message);
  findings.add("messages_per_second", beside.messages_per_second);
  findings.add("messages_per_second_alone", alone.messages_per_second);
  findings.add("rate_kept", beside.messages_per_second / alone.messages_per_second);
  findings.add("rss_growth_bytes", static_cast<double>(resident_bytes(options.process) - resident_before));
  findings.add("lost", static_cast<double>(healthy.lost() + flood.missing()));
  findings.add("wrong", static_cast<double>(healthy.wrong()));
  return findings;
}

}  // namespace gimnet::perf
