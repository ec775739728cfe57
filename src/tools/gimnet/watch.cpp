#include "tools/gimnet/watch.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <ctime>
#include <utility>

#include "base/clock.hpp"
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

// Of what is gone the hub tells only who it was (docs/protocol.md, section 8): nothing else is said
// here.
void write_node(JsonWriter& json, const WatchEvent& event) {
  const NodeRecord& node = *event.node;
  if (event.change != Change::left) return write(json, node);
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

bool is_snapshot(Change change) {
  return change == Change::snapshot_begins || change == Change::present ||
         change == Change::snapshot_ends;
}

std::string json_line(const WatchEvent& event, std::int64_t now_ns) {
  std::string change(change_text(event.change));
  std::ranges::replace(change, ' ', '_');
  JsonWriter json;
  json.begin_object().member("time_ns", now_ns).member("change", change);
  json.member("hub_id", event.hub_id).member("epoch", event.epoch).member("version", event.version);
  if (!event.former_name.empty()) json.member("former_name", event.former_name);
  if (!event.why.empty()) json.member("why", event.why);
  if (event.node) write_node(json.key("node"), event);
  if (event.service) write_service(json.key("service"), event);
  return json.end_object().str() + "\n";
}

std::string text_line(const WatchEvent& event, std::int64_t now_ns, Paint paint) {
  if (!event.node && !event.service) return {};
  std::string change(change_text(event.change));
  constexpr std::size_t kWidth = 10;
  change.append(change.size() < kWidth ? kWidth - change.size() : 0, ' ');
  const std::string words =
      event.node ? node_words(*event.node, event.former_name) : service_words(*event.service);
  return paint(time_text(now_ns) + "  " + change + "  " + words, tone_of(event.change)) + "\n";
}

namespace {

/// There is nothing to print, and there may not be for long.
void say_that_it_waits(const ToolOptions& options) {
  say("nothing " + (options.target.empty() ? "is there" : "matches " + options.target) +
      " yet; waiting");
}

/// Prints what is to be seen. True: it was an event that the user asked for.
bool print(ToolSession& session, ToolFilter& filter, const WatchEvent& event) {
  const ToolOptions& options = session.options();
  if (!options.all && filter.hides(event)) return false;
  if (options.changes && is_snapshot(event.change)) return false;
  const std::int64_t now_ns = wall_now_ns();
  session.output().write(options.json ? json_line(event, now_ns)
                                      : text_line(event, now_ns, session.paint()));
  return event.node.has_value() || event.service.has_value();
}

}  // namespace

ExitCode run_watch(ToolSession& session) {
  if (const auto ending = session.join({})) return *ending;
  const auto watch = session.node().watch(session.options().target);
  if (!watch) return session.fail(watch.failure());
  const Bounds bounds(session.options());
  ConnectionWatch connection(session.node());
  ToolFilter filter;
  const ToolOptions& options = session.options();
  std::uint64_t events = 0;
  bool told = false;
  while (!bounds.enough(events) && !bounds.late() && session.output().ok()) {
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
    if (print(session, filter, *event)) ++events;
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
