#include <algorithm>

#include "generator/process.hpp"
#include "generator/publisher.hpp"
#include "generator/scenario.hpp"

namespace gimnet::perf {
namespace {

constexpr std::size_t kClients = 10'000;
/// Long enough for every client's first keep-alive.
constexpr std::chrono::seconds kSettling{2};

std::size_t count_of(const RunOptions& options) { return options.client_count == 0 ? kClients : options.client_count; }

}  // namespace

/// Resident bytes and processor share of connections that say nothing but keep-alives.
Findings idle(Engine& engine, const RunOptions& options) {
  const std::size_t count = count_of(options);
  const auto resident_before = resident_bytes(options.process);
  engine.connect(count);
  const auto never = [] { return false; };
  std::ignore = engine.poll_until(never, std::min<std::chrono::nanoseconds>(2 * options.duration, kSettling));
  const auto cpu_begin_ns = cpu_time_ns(options.process);
  std::ignore = engine.poll_until(never, options.duration);
  const auto cpu_ns = static_cast<double>(cpu_time_ns(options.process) - cpu_begin_ns);
  const auto resident = static_cast<double>(resident_bytes(options.process) - resident_before);

  Findings findings;
  findings.add("rss_bytes_per_connection", resident / static_cast<double>(count));
  findings.add("cpu_share", cpu_ns / static_cast<double>(options.duration.count()));
  findings.add("connections", static_cast<double>(count));
  return findings;
}

/// Connects and joins many, until a message goes from the last but one to the last: so the subject has accepted all.
Findings connect_many(Engine& engine, const RunOptions& options) {
  const std::size_t count = count_of(options);
  const auto cpu_begin_ns = cpu_time_ns(options.process);
  const auto begin = Clock::now();
  engine.connect(count);
  Client& last = engine.client(count - 1);
  last.inbox.expect(0, options.payload_bytes);
  Publisher publisher(engine.wire(), engine.client(count - 2), {Target{.recipients = {&last}}},
                      MessageShape{.payload_bytes = options.payload_bytes}, Writing::unbatched);
  publisher.publish(1);
  const bool arrived = engine.poll_until([&last] { return last.inbox.settled() > 0; }, std::chrono::seconds(10));
  const double seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  const auto cpu_ns = static_cast<double>(cpu_time_ns(options.process) - cpu_begin_ns);

  Findings findings;
  findings.add("seconds", seconds);
  findings.add("cpu_ns_per_connection", cpu_ns / static_cast<double>(count));
  findings.add("connections", static_cast<double>(count));
  findings.add("lost", arrived ? 0 : 1);
  findings.add("wrong", static_cast<double>(last.inbox.wrong()));
  return findings;
}

}  // namespace gimnet::perf
