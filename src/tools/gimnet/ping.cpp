#include "tools/gimnet/ping.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numeric>

#include "base/clock.hpp"
#include "tools/gimnet/json_writer.hpp"
#include "tools/gimnet/session.hpp"
#include "tools/gimnet/table.hpp"

namespace gimnet::tool {

RoundTrips::Summary RoundTrips::summary_us() const {
  if (ns_.empty()) return {};
  std::vector<std::int64_t> sorted = ns_;
  std::ranges::sort(sorted);
  const auto count = static_cast<double>(sorted.size());
  const auto us = [](std::int64_t ns) { return static_cast<double>(ns) / 1000.0; };
  const auto percentile = [&](double part) {
    const auto rank = static_cast<std::size_t>(std::ceil(part * count));
    return us(sorted[std::clamp<std::size_t>(rank, 1, sorted.size()) - 1]);
  };
  const std::int64_t sum = std::accumulate(sorted.begin(), sorted.end(), std::int64_t{0});
  return {us(sorted.front()), us(sum) / count,   percentile(0.5),
          percentile(0.99),   percentile(0.999), us(sorted.back())};
}

namespace {

struct PingCounts {
  RoundTrips round_trips;
  std::uint64_t sent = 0;
  std::uint64_t lost = 0;
};

std::string one_decimal(double value) { return decimal(value, 1); }

void print_json(ToolSession& session, Peer peer, const PingCounts& counts) {
  const RoundTrips::Summary us = counts.round_trips.summary_us();
  JsonWriter json;
  json.begin_object().member("target", session.options().target).member("id", peer.text());
  json.member("sent", counts.sent).member("lost", counts.lost);
  json.member("min", us.min).member("mean", us.mean).member("p50", us.p50).member("p99", us.p99);
  json.member("p99.9", us.p99_9).member("max", us.max).end_object();
  session.output().write(json.str() + "\n");
}

void print_text(ToolSession& session, const PingCounts& counts) {
  const RoundTrips::Summary us = counts.round_trips.summary_us();
  session.output().write(std::to_string(counts.sent) + " sent, " + std::to_string(counts.lost) +
                         " lost\n");
  if (counts.round_trips.count() == 0) return;
  session.output().write("round trip in us: min " + one_decimal(us.min) + ", mean " +
                         one_decimal(us.mean) + ", p50 " + one_decimal(us.p50) + ", p99 " +
                         one_decimal(us.p99) + ", p99.9 " + one_decimal(us.p99_9) + ", max " +
                         one_decimal(us.max) + "\n");
}

/// Nothing: go on.
std::optional<Failure> ping_once(ToolSession& session, Peer peer, PingCounts& counts) {
  const ToolOptions& options = session.options();
  ++counts.sent;
  const auto answer =
      session.node().ping(peer, Timeout{std::llround(options.timeout_s * 1000.0)}, options.lane);
  if (answer) {
    counts.round_trips.add(*answer);
  } else if (answer.is(Status::bad_argument)) {
    --counts.sent;
    return answer.failure();
  } else if (session.stopped()) {
    --counts.sent;
  } else {
    ++counts.lost;
    // A node that has answered may be out of reach for a while.
    const bool goes_on = answer.is(Status::not_delivered) && counts.round_trips.count() > 0;
    if (!answer.is(Status::timeout) && !goes_on) return answer.failure();
  }
  if (options.json || session.stopped()) return std::nullopt;
  session.output().write(answer ? "answer from " + peer.text() + " in " +
                                      one_decimal(static_cast<double>(*answer) / 1000.0) + " us\n"
                                : answer.failure().sentence + "\n");
  session.output().flush();
  return std::nullopt;
}

}  // namespace

ExitCode run_ping(ToolSession& session) {
  const ToolOptions& options = session.options();
  NodeOptions how;
  how.reconnect = false;
  if (const auto ending = session.join(how)) return *ending;
  const auto peer = session.find(options.target);
  if (!peer) return session.code();
  PingCounts counts;
  std::optional<Failure> failure;
  const auto interval_ns = static_cast<std::int64_t>(std::llround(options.interval_s * 1e9));
  std::int64_t next_ns = steady_now_ns();
  while (counts.sent < options.pings && !failure && session.stop().wait_until(next_ns)) {
    failure = ping_once(session, *peer, counts);
    next_ns = std::max(next_ns + interval_ns, steady_now_ns());
  }
  if (failure && counts.sent == 0) return session.fail(*failure);
  if (options.json) {
    print_json(session, *peer, counts);
  } else {
    print_text(session, counts);
  }
  session.output().flush();
  if (failure) {
    static_cast<void>(session.fail(*failure));
    return failure->status == Status::not_delivered ? ExitCode::not_found
                                                    : exit_code_of(failure->status);
  }
  if (counts.round_trips.count() == 0 && !session.stopped()) {
    return session.fail({Status::timeout, options.target + " answered none of " +
                                              std::to_string(counts.sent) + " pings"});
  }
  return session.finish();
}

}  // namespace gimnet::tool
