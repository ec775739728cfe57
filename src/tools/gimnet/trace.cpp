#include "tools/gimnet/trace.hpp"

#include <algorithm>
#include <cmath>

#include "base/clock.hpp"
#include "tools/gimnet/json_writer.hpp"
#include "tools/gimnet/network.hpp"
#include "tools/gimnet/session.hpp"
#include "tools/gimnet/table.hpp"

namespace gimnet::tool {

void TraceTally::add(const TracedPing& ping) {
  round_trips_.add(ping.round_trip_ns);
  hubs_.clear();
  const std::vector<TraceHop>& way = ping.way_back;
  for (std::size_t i = 0; i < way.size(); ++i) {
    hubs_.push_back(way[i].hub_id);
    delays_[way[i].hub_id].add(way[i].departure_ns - way[i].arrival_ns);
    if (i == 0) continue;
    links_[{way[i].hub_id, way[i - 1].hub_id}].push_back(way[i].arrival_ns -
                                                         way[i - 1].departure_ns);
  }
  std::ranges::reverse(hubs_);
}

std::vector<HopReport> TraceTally::hops(const ClockOffsets& clocks) const {
  std::vector<HopReport> hops;
  ClockOffset sum;  // to the first hub
  bool known = true;
  for (std::size_t i = 0; i < hubs_.size(); ++i) {
    HopReport& hop = hops.emplace_back();
    hop.hub_id = hubs_[i];
    hop.delay_us = delays_.at(hubs_[i]).summary_us();
    if (i > 0) {
      const std::pair ends{hubs_[i - 1], hubs_[i]};
      const auto clock = clocks.find(ends);
      known = known && clock != clocks.end();
      if (clock != clocks.end()) {
        // The answer left by the farther hub's clock, and arrived by the nearer one's.
        RoundTrips corrected;
        for (const std::int64_t ns : links_.at(ends)) corrected.add(ns + clock->second.ns);
        hop.link_us = corrected.summary_us();
        sum.ns += clock->second.ns;
        sum.error_ns += clock->second.error_ns;
      }
    }
    if (!known) continue;
    hop.clock_offset_us = static_cast<double>(sum.ns) / 1000.0;
    hop.clock_error_us = static_cast<double>(sum.error_ns) / 1000.0;
  }
  return hops;
}

namespace {

void write(JsonWriter& json, const RoundTrips::Summary& us) {
  json.begin_object().member("p50", us.p50).member("p99", us.p99).end_object();
}

std::string shown(double us) { return std::isfinite(us) ? decimal(us, 1) : "-"; }

/// A hub reads its clock once a turn: what comes and goes in one has no measured delay.
std::string shown_delay(double us) { return us == 0.0 ? "<turn" : shown(us); }

/// Offsets between neighbours on the way, as far as the hubs can be asked.
ClockOffsets clocks_along(ToolSession& session, const std::vector<std::uint32_t>& hubs) {
  ClockOffsets clocks;
  for (std::size_t i = 0; i + 1 < hubs.size(); ++i) {
    const auto links = session.node().hub_links(kHubPatience, i == 0 ? 0 : hubs[i]);
    if (!links) continue;
    for (const LinkRecord& link : *links) {
      if (link.hub_id != hubs[i + 1] || link.clock_error_ns == 0) continue;
      const ClockOffset found{link.clock_offset_ns, static_cast<std::int64_t>(link.clock_error_ns)};
      const auto [known, first] = clocks.try_emplace({hubs[i], hubs[i + 1]}, found);
      if (!first && found.error_ns < known->second.error_ns) known->second = found;
    }
  }
  return clocks;
}

}  // namespace

std::string json_of(const std::vector<HopReport>& hops, const RoundTrips& trips,
                    std::uint64_t sent) {
  JsonWriter json;
  json.begin_object().key("hops").begin_array();
  for (const HopReport& hop : hops) {
    json.begin_object().member("hub", hop.hub_id);
    write(json.key("delay_us"), hop.delay_us);
    write(json.key("link_us"), hop.link_us);
    json.member("clock_offset_us", hop.clock_offset_us);
    json.member("clock_error_us", hop.clock_error_us).end_object();
  }
  json.end_array();
  write(json.key("round_trip_us"), trips.summary_us());
  json.member("sent", sent).member("lost", sent - trips.count());
  return json.end_object().str() + "\n";
}

std::string text_of(const std::vector<HopReport>& hops) {
  Table table({"HUB", "DELAY p50 us", "p99", "LINK p50 us", "p99", "CLOCK us", "ERROR us"});
  for (const HopReport& hop : hops) {
    table.add({std::to_string(hop.hub_id), shown_delay(hop.delay_us.p50),
               shown_delay(hop.delay_us.p99), shown(hop.link_us.p50), shown(hop.link_us.p99),
               shown(hop.clock_offset_us), shown(hop.clock_error_us)});
  }
  return table.text();
}

ExitCode run_trace(ToolSession& session) {
  const ToolOptions& options = session.options();
  NodeOptions how;
  how.reconnect = false;
  if (const auto ending = session.join(how)) return *ending;
  const auto peer = session.find(options.target);
  if (!peer) return session.code();
  const Timeout patience{std::llround(options.timeout_s * 1000.0)};
  // The hub's report of a lost frame shows its extensions, and not which ping it was.
  const auto there = session.node().ping(*peer, patience, options.lane);
  if (!there && !there.is(Status::timeout)) {
    const ExitCode code = session.fail(there.failure());
    return there.is(Status::not_delivered) ? ExitCode::not_found : code;
  }
  TraceTally tally;
  std::uint64_t sent = 0;
  const auto interval_ns = static_cast<std::int64_t>(std::llround(options.interval_s * 1e9));
  std::int64_t next_ns = steady_now_ns();
  while (sent < options.pings && session.stop().wait_until(next_ns)) {
    const auto answer = session.node().trace(*peer, patience, options.lane);
    if (session.stopped()) break;
    ++sent;
    if (answer) tally.add(*answer);
    if (!answer && !answer.is(Status::timeout)) return session.fail(answer.failure());
    next_ns = std::max(next_ns + interval_ns, steady_now_ns());
  }
  if (tally.round_trips().count() == 0 && !session.stopped()) {
    return session.fail(
        {Status::timeout, options.target + " answered none of " + std::to_string(sent) + " pings"});
  }
  if (tally.hubs().empty() && !session.stopped())
    say(options.target + " answers without a trace: its library is of an earlier version");
  const auto hops = tally.hops(clocks_along(session, tally.hubs()));
  if (options.json) {
    session.output().write(json_of(hops, tally.round_trips(), sent));
  } else {
    const RoundTrips::Summary us = tally.round_trips().summary_us();
    session.output().write(text_of(hops) + "round trip in us: p50 " + shown(us.p50) + ", p99 " +
                           shown(us.p99) + "; " + std::to_string(sent) + " sent, " +
                           std::to_string(sent - tally.round_trips().count()) + " lost\n");
  }
  return session.finish();
}

}  // namespace gimnet::tool
