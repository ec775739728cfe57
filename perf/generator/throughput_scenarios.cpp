#include <algorithm>

#include "generator/flood.hpp"
#include "generator/process.hpp"
#include "generator/scenario.hpp"

namespace gimnet::perf {
namespace {

constexpr std::chrono::milliseconds kWarmUp{150};

struct Traffic {
  std::vector<Publisher> publishers;
  std::size_t recipients_a_message = 1;
};

struct Counts {
  std::uint64_t delivered = 0;
  std::uint64_t lost = 0;
  std::uint64_t wrong = 0;
};

Counts count_inboxes(Engine& engine) {
  Counts counts;
  for (std::size_t index = 0; index < engine.client_count(); ++index) {
    const Inbox& inbox = engine.client(index).inbox;
    counts.delivered += inbox.delivered();
    counts.lost += inbox.lost();
    counts.wrong += inbox.wrong();
  }
  return counts;
}

/// Warms up, then measures from rest to rest, so that the processor time belongs to exactly the
/// messages counted.
Findings measure(Engine& engine, const RunOptions& options, Traffic traffic) {
  Flood flood(engine, std::move(traffic.publishers), traffic.recipients_a_message);
  flood.warm_up(std::min<std::chrono::nanoseconds>(kWarmUp, options.duration));
  const Counts before = count_inboxes(engine);
  const auto begin = Clock::now();
  const auto cpu_begin_ns = cpu_time_ns(options.process);
  flood.run_for(options.duration);
  flood.drain();
  const auto cpu_ns = static_cast<double>(cpu_time_ns(options.process) - cpu_begin_ns);
  const double seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  const Counts after = count_inboxes(engine);
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

Findings pairs(Engine& engine, const RunOptions& options, std::size_t pair_count, Writing writing) {
  engine.connect(2 * pair_count);
  Traffic traffic;
  for (std::size_t pair = 0; pair < pair_count; ++pair) {
    const auto stream = static_cast<StreamId>(pair);
    Client& to = engine.client(2 * pair + 1);
    engine.open_publisher(engine.client(2 * pair));
    to.inbox.expect(stream, options.payload_bytes);
    const Target target{.kind = Target::Kind::unicast, .recipients = {&to}, .stream = stream};
    traffic.publishers.emplace_back(engine.wire(), engine.client(2 * pair), std::vector{target},
                                    MessageShape{.payload_bytes = options.payload_bytes}, writing);
  }
  return measure(engine, options, std::move(traffic));
}

/// One message of client 0 to all others.
Findings to_all(Engine& engine, const RunOptions& options, Target target,
                std::size_t recipient_count) {
  for (std::size_t index = 1; index <= recipient_count; ++index) {
    engine.client(index).inbox.expect(target.stream, options.payload_bytes);
  }
  engine.open_publisher(engine.client(0));
  Traffic traffic;
  traffic.recipients_a_message = recipient_count;
  traffic.publishers.emplace_back(engine.wire(), engine.client(0), std::vector{std::move(target)},
                                  MessageShape{.payload_bytes = options.payload_bytes},
                                  Writing::batched);
  return measure(engine, options, std::move(traffic));
}

}  // namespace

Findings one_to_one(Engine& engine, const RunOptions& options) {
  return pairs(engine, options, 1, Writing::batched);
}

Findings one_to_one_unbatched(Engine& engine, const RunOptions& options) {
  return pairs(engine, options, 1, Writing::unbatched);
}

Findings four_to_four(Engine& engine, const RunOptions& options) {
  return pairs(engine, options, 4, Writing::batched);
}

Findings in_turns(Engine& engine, const RunOptions& options) {
  constexpr std::size_t kDestinations = 8;
  engine.connect(1 + kDestinations);
  std::vector<Target> targets;
  for (std::size_t index = 1; index <= kDestinations; ++index) {
    const auto stream = static_cast<StreamId>(index);
    Client& to = engine.client(index);
    to.inbox.expect(stream, options.payload_bytes);
    targets.push_back({.kind = Target::Kind::unicast, .recipients = {&to}, .stream = stream});
  }
  engine.open_publisher(engine.client(0));
  Traffic traffic;
  traffic.publishers.emplace_back(engine.wire(), engine.client(0), targets,
                                  MessageShape{.payload_bytes = options.payload_bytes},
                                  Writing::batched);
  return measure(engine, options, std::move(traffic));
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
  return to_all(engine, options, std::move(target), kRecipients);
}

Findings broadcast_100(Engine& engine, const RunOptions& options) {
  constexpr std::size_t kRecipients = 100;
  engine.connect(1 + kRecipients);
  return to_all(engine, options, {.kind = Target::Kind::broadcast, .recipients = {}}, kRecipients);
}

}  // namespace gimnet::perf
