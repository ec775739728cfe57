#include "tools/gimnet/watch.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <ctime>
#include <tuple>
#include <utility>

#include "base/clock.hpp"
#include "base/ids.hpp"
#include "tools/gimnet/bounds.hpp"
#include "tools/gimnet/json_writer.hpp"
#include "tools/gimnet/session.hpp"

namespace gimnet::tool {
namespace {

Tone tone_of(Change change) {
  switch (change) {
    case Change::left:
    case Change::withdrawn:
      return Tone::bad;
    case Change::away:
      return Tone::warning;
    default:
      return Tone::plain;
  }
}

/// "12:34:56.789", local time.
std::string time_text(std::int64_t ns) {
  const auto seconds = static_cast<std::time_t>(ns / 1'000'000'000);
  std::tm parts{};
  ::localtime_r(&seconds, &parts);
  std::array<char, 48> text{};
  std::snprintf(text.data(), text.size(), "%02d:%02d:%02d.%03d", parts.tm_hour, parts.tm_min,
                parts.tm_sec, static_cast<int>(ns / 1'000'000 % 1'000));
  return text.data();
}

/// `words` behind the time and the change.
std::string line_of(std::int64_t now_ns, std::string change, const std::string& words) {
  constexpr std::size_t kWidth = 11;
  change.append(change.size() < kWidth ? kWidth - change.size() : 0, ' ');
  return time_text(now_ns) + "  " + change + "  " + words;
}

std::string node_words(const NodeRecord& node, const std::string& former_name) {
  std::string words =
      "node " + (node.name.empty() ? std::string("-") : node.name) + " " + node.node.text();
  if (!former_name.empty()) words += ", before " + former_name;
  if (!node.place.empty()) words += ", from " + node.place;
  if (!node.description.empty()) words += ", " + node.description;
  return printable(words);
}

std::string service_words(const ServiceRecord& service) {
  std::string words = "service " + service.name + " of " + service.node.text();
  if (!service.metadata.empty()) words += ", " + service.metadata;
  return printable(words);
}

std::string difference(const NodeRecord& before, const NodeRecord& now) {
  std::string words;
  if (before.description != now.description)
    words += " description " + (before.description.empty() ? "none" : before.description);
  if (before.place != now.place) words += " place " + before.place;
  if (before.connected != now.connected) words += before.connected ? " connected" : " away";
  if (before.services != now.services) words += " services " + std::to_string(before.services);
  return words;
}

std::string difference(const ServiceRecord& before, const ServiceRecord& now) {
  std::string words;
  if (before.node.id != now.node.id) words += " node " + before.node.text();
  if (before.metadata != now.metadata)
    words += " metadata " + (before.metadata.empty() ? "none" : before.metadata);
  const auto terms = [](const ServiceRecord& each) {
    return std::tuple(each.key.type, each.key.instance, each.direction, each.delivery, each.window,
                      each.retain);
  };
  if (terms(before) != terms(now)) words += " other terms";
  return words;
}

// Of what is gone the hub tells only who it was (docs/protocol.md, section 8): nothing else is said
// here.
void write_node(JsonWriter& json, const WatchEvent& event, const HubWays& ways) {
  const NodeRecord& node = *event.node;
  if (event.change != Change::left) return write(json, node, ways.standing_of(node));
  json.begin_object()
      .member("id", node.node.text())
      .member("name", node.name)
      .member("hub_id", node.hub_id);
  json.end_object();
}

void write_service(JsonWriter& json, const WatchEvent& event) {
  const ServiceRecord& service = *event.service;
  if (event.change != Change::withdrawn) return write(json, service);
  json.begin_object().member("name", service.name).member("node", service.node.text());
  json.member("group", service.group_id).end_object();
}

}  // namespace

bool is_tool(const NodeRecord& node) {
  return node.name.empty() && node.description == kToolDescription;
}

bool ToolFilter::hides(const WatchEvent& event) {
  if (event.change == Change::snapshot_begins) hidden_.clear();
  if (!event.node) return false;
  const std::uint32_t id = event.node->node.id;
  if (event.change == Change::left) return hidden_.erase(id) != 0;
  if (is_tool(*event.node)) hidden_.insert(id);
  return hidden_.contains(id);
}

std::vector<NetworkHub> HubWays::take(const std::vector<NetworkHub>& hubs) {
  std::map<std::uint32_t, NetworkHub> now;
  for (const NetworkHub& hub : hubs) now[hub.hub_id] = hub;
  const auto before = std::exchange(known_, now);
  if (!before) return {};
  std::vector<NetworkHub> changed;
  for (const auto& [id, hub] : now) {
    const auto former = before->find(id);
    const bool was_reachable = former != before->end() && former->second.reachable;
    if (was_reachable != hub.reachable) changed.push_back(hub);
  }
  for (auto [id, hub] : *before) {
    if (now.contains(id) || !hub.reachable) continue;
    hub.reachable = false;
    changed.push_back(hub);
  }
  return changed;
}

std::string_view HubWays::standing_of(const NodeRecord& node) const {
  if (node.connected) return "connected";
  if (!known_) return "away";
  const auto hub = known_->find(node.hub_id);
  return hub == known_->end() || hub->second.reachable ? "away" : kUnreachable;
}

std::string WatchMemory::take(const WatchEvent& event) {
  if (event.change == Change::snapshot_begins) {
    nodes_.clear();
    services_.clear();
  }
  std::string before;
  const auto note = [&]<class Record>(auto& records, const auto& key, const Record& now,
                                      bool gone) {
    const auto known = records.find(key);
    if (event.change == Change::changed && known != records.end())
      before = difference(known->second, now);
    if (gone) {
      records.erase(key);
    } else {
      records[key] = now;
    }
  };
  if (event.node) note(nodes_, event.node->node.id, *event.node, event.change == Change::left);
  if (event.service)
    note(services_, event.service->name, *event.service, event.change == Change::withdrawn);
  return before.empty() ? before : ", before:" + before;
}

bool is_snapshot(Change change) {
  return change == Change::snapshot_begins || change == Change::present ||
         change == Change::snapshot_ends;
}

std::string json_line(const WatchEvent& event, std::int64_t now_ns, const HubWays& ways) {
  std::string change(change_text(event.change));
  std::ranges::replace(change, ' ', '_');
  JsonWriter json;
  json.begin_object().member("time_ns", now_ns).member("change", change);
  json.member("hub_id", event.hub_id).member("epoch", event.epoch).member("version", event.version);
  if (!event.former_name.empty()) json.member("former_name", event.former_name);
  if (!event.why.empty()) json.member("why", event.why);
  if (event.node) write_node(json.key("node"), event, ways);
  if (event.service) write_service(json.key("service"), event);
  return json.end_object().str() + "\n";
}

std::string text_line(const WatchEvent& event, std::int64_t now_ns, Paint paint,
                      const HubWays& ways, std::string_view before) {
  if (!event.node && !event.service) return {};
  std::string words =
      event.node ? node_words(*event.node, event.former_name) : service_words(*event.service);
  if (event.node && event.change == Change::present && !event.node->connected)
    words += ", " + std::string(ways.standing_of(*event.node));
  words += printable(std::string(before));
  return paint(line_of(now_ns, std::string(change_text(event.change)), words),
               tone_of(event.change)) +
         "\n";
}

std::string json_line(const NetworkHub& hub, std::int64_t now_ns) {
  JsonWriter json;
  json.begin_object().member("time_ns", now_ns);
  json.member("change", hub.reachable ? "reachable" : kUnreachable);
  json.member("hub_id", hub.hub_id).member("hub", hub.name);
  return json.end_object().str() + "\n";
}

std::string text_line(const NetworkHub& hub, std::int64_t now_ns, Paint paint) {
  const std::string words = "hub " + std::to_string(hub.hub_id) + " " + printable(hub.name);
  return paint(line_of(now_ns, hub.reachable ? "reachable" : kUnreachable, words),
               hub.reachable ? Tone::plain : Tone::warning) +
         "\n";
}

namespace {

/// There is nothing to print, and there may not be for long.
void say_that_it_waits(const ToolOptions& options) {
  say("nothing " + (options.target.empty() ? "is there" : "matches " + options.target) +
      " yet; waiting");
}

/// Prints what is to be seen. Thread safety: one thread.
class WatchPrinter {
 public:
  explicit WatchPrinter(ToolSession& session) : session_(session) {}

  /// True: it was an event that the user asked for.
  bool print(const WatchEvent& event) {
    const ToolOptions& options = session_.options();
    if (!options.all && filter_.hides(event)) return false;
    if (event.node) hubs_.insert(event.node->hub_id);
    if (event.service) hubs_.insert(hub_of(NodeId{event.service->node.id}).value());
    const std::string before = memory_.take(event);
    if (options.changes && is_snapshot(event.change)) return false;
    const std::int64_t now_ns = wall_now_ns();
    session_.output().write(options.json
                                ? json_line(event, now_ns, ways_)
                                : text_line(event, now_ns, session_.paint(), ways_, before));
    return event.node.has_value() || event.service.has_value();
  }

  /// Once a second, asks for ways to hubs, of which a watch does not tell, and prints those that
  /// came or went: all of them, or with a pattern those of the nodes and services seen. `now_ns`:
  /// steady_now_ns().
  void look_at_hubs(std::int64_t now_ns) {
    if (now_ns < next_look_ns_ || !session_.node().state().connected) return;
    next_look_ns_ = now_ns + 1'000'000'000;
    const auto hubs = session_.node().hubs(ConnectionWatch::kPeriod);
    if (!hubs) return;
    for (const NetworkHub& hub : ways_.take(*hubs)) {
      if (!session_.options().target.empty() && !hubs_.contains(hub.hub_id)) continue;
      session_.output().write(session_.options().json
                                  ? json_line(hub, wall_now_ns())
                                  : text_line(hub, wall_now_ns(), session_.paint()));
    }
  }

 private:
  ToolSession& session_;
  ToolFilter filter_;
  HubWays ways_;
  WatchMemory memory_;
  std::set<std::uint32_t> hubs_;  ///< of nodes and services that match
  std::int64_t next_look_ns_ = 0;
};

}  // namespace

ExitCode run_watch(ToolSession& session) {
  if (const auto ending = session.join({})) return *ending;
  const auto watch = session.node().watch(session.options().target);
  if (!watch) return session.fail(watch.failure());
  const Bounds bounds(session.options());
  ConnectionWatch connection(session.node());
  WatchPrinter printer(session);
  const ToolOptions& options = session.options();
  std::uint64_t events = 0;
  bool told = false;
  while (!bounds.enough(events) && !bounds.late() && session.output().ok()) {
    printer.look_at_hubs(steady_now_ns());
    auto event = watch->receive(kNoWait);
    if (!event && event.is(Status::timeout)) {
      session.output().flush();
      event = watch->receive(bounds.wait(ConnectionWatch::kPeriod));
    }
    connection.look_now_and_then(steady_now_ns());
    if (!event && event.is(Status::timeout)) continue;
    if (!event) {
      connection.look_at_end();
      return session.fail(event.failure());
    }
    if (printer.print(*event)) ++events;
    if (event->change == Change::snapshot_ends && events == 0 && !options.changes &&
        !std::exchange(told, true)) {
      say_that_it_waits(options);
    }
    if (event->change != Change::ended) continue;
    session.output().flush();
    return session.fail({Status::refused, "the hub ended the watch: " + event->why});
  }
  return session.finish_stream(bounds, events);
}

}  // namespace gimnet::tool
