#include <algorithm>
#include <thread>

#include "generator/flood.hpp"
#include "generator/process.hpp"
#include "generator/scenario.hpp"

namespace gimnet::perf {
namespace {

constexpr std::size_t kClients = 10'000;
/// Long enough for every client's first keep-alive.
constexpr std::chrono::seconds kSettling{2};
/// A subject that has just started still does what belongs to that.
constexpr std::chrono::milliseconds kStarting{500};

std::size_t count_of(const RunOptions& options) {
  return options.client_count == 0 ? kClients : options.client_count;
}

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

bool never() { return false; }

/// Of a subject that answers none, or needs none, there is nothing to wait for.
void await_answers(Engine& engine) {
  const KeepAlives& words = engine.wire().keep_alives();
  const bool answered =
      engine.poll_until([&words] { return words.answered == words.said; }, engine.answer_limit());
  if (!answered) fail("the subject did not answer all keep-alives in time");
}

}  // namespace

/// Resident bytes and processor time of connections that say nothing but keep-alives. Word and
/// answer are one keep-alive.
Findings idle(Engine& engine, const RunOptions& options) {
  const auto count = static_cast<double>(count_of(options));
  const auto resident_before = resident_bytes(options.process);
  engine.connect(count_of(options));
  std::ignore =
      engine.poll_until(never, std::min<std::chrono::nanoseconds>(2 * options.duration, kSettling));
  await_answers(engine);
  const KeepAlives before = engine.wire().keep_alives();
  const auto cpu_begin_ns = cpu_time_ns(options.process);
  const auto begin = Clock::now();
  std::ignore = engine.poll_until(never, options.duration);
  await_answers(engine);
  const KeepAlives& after = engine.wire().keep_alives();
  const std::uint64_t keep_alives = after.answered - before.answered + after.asked - before.asked;
  const auto cpu_ns = static_cast<double>(cpu_time_ns(options.process) - cpu_begin_ns);
  const double seconds = seconds_since(begin);

  Findings findings;
  findings.add("rss_bytes_per_connection",
               static_cast<double>(resident_bytes(options.process) - resident_before) / count);
  findings.add("cpu_share", cpu_ns / 1e9 / seconds);
  findings.add("connections", count);
  if (keep_alives == 0) return findings;
  findings.add("keep_alives_per_second", static_cast<double>(keep_alives) / seconds);
  findings.add("keep_alive_ns", cpu_ns / static_cast<double>(keep_alives));
  return findings;
}

/// The work of a subject to which nobody is connected.
Findings idle_alone(Engine& engine, const RunOptions& options) {
  std::this_thread::sleep_for(std::min<std::chrono::nanoseconds>(options.duration, kStarting));
  const auto switches_begin = context_switches(options.process);
  const auto cpu_begin_ns = cpu_time_ns(options.process);
  const auto begin = Clock::now();
  std::this_thread::sleep_for(options.duration);
  const auto cpu_ns = static_cast<double>(cpu_time_ns(options.process) - cpu_begin_ns);
  const auto switches = static_cast<double>(context_switches(options.process) - switches_begin);
  const double seconds = seconds_since(begin);
  engine.connect(1);  // it still answers, and tells its ledger

  Findings findings;
  findings.add("cpu_share", cpu_ns / 1e9 / seconds);
  findings.add("context_switches_per_second", switches / seconds);
  return findings;
}

/// Connects and joins many, until a message goes from the last but one to the last: so the subject
/// has accepted all.
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
  const bool arrived =
      engine.poll_until([&last] { return last.inbox.settled() > 0; }, engine.answer_limit());
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
