#include "tools/gimnet/network.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <utility>

#include "base/ids.hpp"
#include "tools/gimnet/session.hpp"

namespace gimnet::tool {
namespace {

/// `null` in JSON.
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

JsonWriter& member_if(bool known, JsonWriter& json, std::string_view name, std::uint32_t value) {
  return known ? json.member(name, value) : json.member(name, kUnknown);
}

std::string text_if(bool known, std::uint32_t value) { return known ? std::to_string(value) : "-"; }

/// A way, or one that is too long to go.
bool has_length(const NetworkHub& hub) { return hub.reachable || hub.too_far; }
/// A link that has just come up has no cost until its round trip was measured.
bool has_cost(const NetworkHub& hub) {
  return has_length(hub) && (hub.cost != 0 || hub.distance == 0);
}
bool has_cost(const RouteStep& step) { return step.cost != 0 || step.distance == 0; }
bool has_cost(const GraphEdge& edge) { return edge.cost != 0; }

double microseconds(double ns) { return ns / 1000.0; }

std::string title_of(const NetworkHub& hub) {
  return std::to_string(hub.hub_id) + (hub.name.empty() ? "" : " " + printable(hub.name));
}

/// For Graphviz.
std::string quoted(std::string_view text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') result += '\\';
    result += c;
  }
  return result + "\"";
}

}  // namespace

std::string json_of(const std::vector<NetworkHub>& hubs) {
  JsonWriter json;
  json.begin_array();
  for (const NetworkHub& hub : hubs) {
    json.begin_object().member("id", hub.hub_id).member("name", hub.name);
    json.member("version", hub.version);
    member_if(has_length(hub), json, "distance", hub.distance);
    member_if(has_cost(hub), json, "cost", hub.cost);
    member_if(hub.next_hop != 0, json, "via", hub.next_hop);
    json.member("nodes", hub.nodes).member("services", hub.services);
    json.member("reachable", hub.reachable).member("too_far", hub.too_far).end_object();
  }
  return json.end_array().str() + "\n";
}

std::string text_of(const std::vector<NetworkHub>& hubs, Paint paint) {
  Table table({"HUB", "NAME", "STATE", "DISTANCE", "COST", "VIA", "NODES", "SERVICES", "VERSION"});
  for (const NetworkHub& hub : hubs) {
    const bool right = hub.reachable && !hub.too_far;
    table.add({std::to_string(hub.hub_id), hub.name,
               hub.too_far     ? "too far"
               : hub.reachable ? "reachable"
                               : kUnreachable,
               text_if(has_length(hub), hub.distance), text_if(has_cost(hub), hub.cost),
               text_if(hub.next_hop != 0, hub.next_hop), std::to_string(hub.nodes),
               std::to_string(hub.services), hub.version},
              right ? Tone::plain : Tone::warning);
  }
  return table.text(paint);
}

void write(JsonWriter& json, const std::vector<LinkRecord>& links) {
  json.begin_array();
  for (const LinkRecord& link : links) {
    json.begin_object().member("name", link.name);
    member_if(link.hub_id != 0, json, "hub", link.hub_id);
    json.member("peer", link.peer).member("state", link.state).member("dialled", link.dialled);
    member_if(link.cost != 0, json, "cost", link.cost);
    member_if(link.rtt_us != 0, json, "rtt_us", link.rtt_us);
    const bool clock = link.clock_error_ns != 0;
    json.member("clock_offset_us",
                clock ? microseconds(static_cast<double>(link.clock_offset_ns)) : kUnknown);
    json.member("clock_error_us",
                clock ? microseconds(static_cast<double>(link.clock_error_ns)) : kUnknown);
    json.member("queued_bytes", link.queued_bytes).member("sent_bytes", link.sent_bytes);
    json.member("received_bytes", link.received_bytes).member("accepted", link.accepted);
    json.member("delivered", link.delivered).member("dropped", link.dropped);
    json.member("unsure", link.unsure).member("queue_full", link.queue_full);
    if (link.last_error.empty()) {
      json.member("last_error", kUnknown);
    } else {
      json.member("last_error", link.last_error);
    }
    json.end_object();
  }
  json.end_array();
}

std::string json_of(const std::vector<LinkRecord>& links) {
  JsonWriter json;
  write(json, links);
  return json.str() + "\n";
}

std::string text_of(const std::vector<LinkRecord>& links, Paint paint) {
  Table table({"NAME", "HUB", "STATE", "COST", "RTT us", "QUEUED", "SENT", "RECEIVED", "DROPPED",
               "PEER", "LAST ERROR"});
  for (const LinkRecord& link : links) {
    const bool right = link.state == "up" || link.state == "standby";
    // The other hub chose the name of a link that it dialled, mostly this hub's address.
    const bool from = !link.dialled && link.hub_id != 0;
    table.add(
        {from ? "from hub " + std::to_string(link.hub_id) : link.name,
         text_if(link.hub_id != 0, link.hub_id), link.state, text_if(link.cost != 0, link.cost),
         text_if(link.rtt_us != 0, link.rtt_us), std::to_string(link.queued_bytes),
         std::to_string(link.sent_bytes), std::to_string(link.received_bytes),
         std::to_string(link.dropped), link.peer, link.last_error},
        right ? Tone::plain : Tone::warning);
  }
  return table.text(paint);
}

std::string json_of(const std::vector<RouteStep>& way) {
  JsonWriter json;
  json.begin_array();
  for (const RouteStep& step : way) {
    json.begin_object().member("hub", step.hub_id).member("name", step.name);
    json.member("next_hop", step.next_hop).member("distance", step.distance);
    member_if(has_cost(step), json, "cost", step.cost).end_object();
  }
  return json.end_array().str() + "\n";
}

std::string text_of(const std::vector<RouteStep>& way) {
  Table table({"HUB", "NAME", "NEXT", "DISTANCE", "COST"});
  for (const RouteStep& step : way) {
    table.add({std::to_string(step.hub_id), step.name, std::to_string(step.next_hop),
               std::to_string(step.distance), text_if(has_cost(step), step.cost)});
  }
  return table.text();
}

std::vector<GraphEdge> edges_of(const std::vector<NetworkHub>& hubs) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, GraphEdge> edges;
  for (const NetworkHub& hub : hubs) {
    for (const NetworkHub::Edge& edge : hub.edges) {
      const auto ends = std::minmax(hub.hub_id, edge.hub_id);
      const auto [found, first] =
          edges.try_emplace(ends, GraphEdge{ends.first, ends.second, edge.cost, false});
      if (first) continue;
      const bool known = has_cost(found->second) && edge.cost != 0;
      found->second.cost = known ? std::max(found->second.cost, edge.cost) : 0;
      found->second.agreed = true;
    }
  }
  std::vector<GraphEdge> all;
  all.reserve(edges.size());
  for (const auto& [ends, edge] : edges) all.push_back(edge);
  return all;
}

std::string graph_json(const std::vector<NetworkHub>& hubs) {
  JsonWriter json;
  json.begin_object().key("hubs").begin_array();
  for (const NetworkHub& hub : hubs) {
    json.begin_object().member("id", hub.hub_id).member("name", hub.name);
    json.member("reachable", hub.reachable).end_object();
  }
  json.end_array().key("links").begin_array();
  for (const GraphEdge& edge : edges_of(hubs)) {
    json.begin_object().member("a", edge.a).member("b", edge.b);
    member_if(has_cost(edge), json, "cost", edge.cost);
    json.member("agreed", edge.agreed).end_object();
  }
  return json.end_array().end_object().str() + "\n";
}

std::string graph_dot(const std::vector<NetworkHub>& hubs) {
  std::string text = "graph gimnet {\n";
  for (const NetworkHub& hub : hubs) {
    text += "  " + std::to_string(hub.hub_id) + " [label=" + quoted(title_of(hub)) +
            (hub.reachable ? "" : ", style=dashed") + "];\n";
  }
  for (const GraphEdge& edge : edges_of(hubs)) {
    text += "  " + std::to_string(edge.a) + " -- " + std::to_string(edge.b) + " [label=\"" +
            text_if(has_cost(edge), edge.cost) + "\"" + (edge.agreed ? "" : ", style=dashed") +
            "];\n";
  }
  return text + "}\n";
}

std::string graph_ascii(const std::vector<NetworkHub>& hubs) {
  const std::vector<GraphEdge> edges = edges_of(hubs);
  std::string text;
  for (const NetworkHub& hub : hubs) {
    text += title_of(hub) + (hub.reachable ? "" : " (unreachable)");
    const char* between = " -- ";
    for (const GraphEdge& edge : edges) {
      if (edge.a != hub.hub_id && edge.b != hub.hub_id) continue;
      const std::uint32_t other = edge.a == hub.hub_id ? edge.b : edge.a;
      text += between + std::to_string(other) + " (" + text_if(has_cost(edge), edge.cost) +
              (edge.agreed ? ")" : ", one-sided)");
      between = ", ";
    }
    text += "\n";
  }
  return text;
}

namespace {

/// Ends a command that asks one hub of the network.
template <class Records>
ExitCode show(ToolSession& session, const Outcome<Records>& found) {
  if (!found) return session.fail(found.failure());
  session.output().write(session.options().json ? json_of(*found)
                                                : text_of(*found, session.paint()));
  return session.finish();
}

/// More hubs than any way has.
constexpr std::size_t kWayMax = 64;

/// Follows the next hops from one hub to another, as far as they can be asked.
Outcome<std::vector<RouteStep>> way_to(ToolSession& session, std::uint32_t target) {
  std::vector<RouteStep> way;
  std::uint32_t at = session.options().hub_id;  // 0: the own hub
  while (way.size() < kWayMax) {
    const auto hubs = session.node().hubs(kHubPatience, at);
    if (!hubs && way.empty()) return hubs.failure();
    if (!hubs) {
      say("hub " + std::to_string(at) + " cannot be asked: " + hubs.failure().sentence);
      return way;
    }
    const auto found = std::ranges::find(*hubs, target, &NetworkHub::hub_id);
    const auto self = std::ranges::find_if(
        *hubs, [](const NetworkHub& hub) { return hub.distance == 0 && hub.reachable; });
    const std::string who = self == hubs->end() ? "the hub" : "hub " + title_of(*self);
    if (found == hubs->end() || !found->reachable || found->too_far) {
      const bool far = found != hubs->end() && found->too_far;
      return Failure{Status::not_found,
                     who + " has no way to hub " + std::to_string(target) +
                         (far ? ": it is too far" : "; `gimnet hubs` lists those that it knows")};
    }
    if (self == hubs->end()) return way;
    way.push_back({self->hub_id, self->name, found->next_hop, found->distance, found->cost});
    if (self->hub_id == target) return way;
    at = found->next_hop;
  }
  return way;
}

}  // namespace

ExitCode run_hubs(ToolSession& session) {
  if (const auto ending = session.join_to_look()) return *ending;
  return show(session, session.node().hubs(kHubPatience, session.options().hub_id));
}

ExitCode run_links(ToolSession& session) {
  if (const auto ending = session.join_to_look()) return *ending;
  return show(session, session.node().hub_links(kHubPatience, session.options().hub_id));
}

ExitCode run_routes(ToolSession& session) {
  if (const auto ending = session.join_to_look()) return *ending;
  const auto peer = session.find(session.options().target);
  if (!peer) return session.code();
  const auto way = way_to(session, hub_of(NodeId{peer->id}).value());
  if (!way) return session.fail(way.failure());
  // An id is not looked up: only its hub knows whether a node has it.
  if (Peer::parse(session.options().target)) {
    const auto there = session.node().ping(*peer, Timeout{500});
    if (there.is(Status::not_delivered))
      return session.fail({Status::not_found, there.failure().sentence});
  }
  session.output().write(session.options().json ? json_of(*way) : text_of(*way));
  return session.finish();
}

ExitCode run_graph(ToolSession& session) {
  if (const auto ending = session.join_to_look()) return *ending;
  const ToolOptions& options = session.options();
  const auto hubs = session.node().hubs(kHubPatience, options.hub_id);
  if (!hubs) return session.fail(hubs.failure());
  session.output().write(options.json  ? graph_json(*hubs)
                         : options.dot ? graph_dot(*hubs)
                                       : graph_ascii(*hubs));
  return session.finish();
}

}  // namespace gimnet::tool
