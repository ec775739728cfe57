#include <cstdint>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "tools/gimnet/hub_status.hpp"
#include "tools/gimnet/json_writer.hpp"
#include "tools/gimnet/session.hpp"
#include "tools/gimnet/table.hpp"
#include "tools/gimnet/watch.hpp"

namespace gimnet::tool {
namespace {

std::string json_of(const std::vector<NodeRecord>& nodes) {
  JsonWriter json;
  json.begin_array();
  for (const NodeRecord& node : nodes) write(json, node);
  return json.end_array().str() + "\n";
}

std::string table_of(const std::vector<NodeRecord>& nodes, Paint paint) {
  Table table({"ID", "NAME", "HUB", "STATE", "SERVICES", "SINCE", "PLACE", "DESCRIPTION"});
  for (const NodeRecord& node : nodes) {
    table.add({node.node.text(), node.name.empty() ? "-" : node.name, node.hub_name,
               node.connected ? "connected" : "away", std::to_string(node.services),
               std::to_string(node.joined_ms / 1000) + " s", node.place, node.description},
              node.connected ? Tone::plain : Tone::warning);
  }
  return table.text(paint);
}

}  // namespace

ExitCode run_nodes(ToolSession& session) {
  if (const auto ending = session.join_to_look()) return *ending;
  const ToolOptions& options = session.options();
  // No name reads as an id does, so that nothing else can be meant.
  const auto id = Peer::parse(options.target);
  auto nodes = session.node().nodes(id ? std::string() : options.target);
  if (!nodes) return session.fail(nodes.failure());
  if (id) std::erase_if(*nodes, [&](const NodeRecord& node) { return node.node.id != id->id; });
  if (!options.all) std::erase_if(*nodes, is_tool);
  session.output().write(options.json ? json_of(*nodes) : table_of(*nodes, session.paint()));
  if (nodes->empty() && !options.target.empty()) return session.fail_unmatched("node");
  return session.finish();
}

namespace {

/// Where nodes are, as their hubs see them. A node that came or went between the two listings has
/// no place.
class Places {
 public:
  explicit Places(const std::vector<NodeRecord>& nodes) {
    for (const NodeRecord& node : nodes) by_id_.emplace(node.node.id, node.place);
  }
  [[nodiscard]] std::string_view of(Peer node) const {
    const auto found = by_id_.find(node.id);
    return found == by_id_.end() ? std::string_view() : found->second;
  }

 private:
  std::unordered_map<std::uint32_t, std::string> by_id_;
};

std::string json_of(const std::vector<ServiceRecord>& services, const Places& places) {
  JsonWriter json;
  json.begin_array();
  for (const ServiceRecord& service : services) write(json, service, places.of(service.node));
  return json.end_array().str() + "\n";
}

std::string table_of(const std::vector<ServiceRecord>& services, const Places& places,
                     Paint paint) {
  Table table({"NAME", "NODE", "HUB", "PLACE", "TYPE", "DIRECTION", "DELIVERY", "RETAIN",
               "SUBSCRIBERS", "METADATA"});
  for (const ServiceRecord& service : services) {
    table.add({service.name, service.node.text(), service.hub_name,
               std::string(places.of(service.node)),
               std::to_string(service.key.type) + "/" + std::to_string(service.key.instance),
               text_of(service.direction), delivery_of(service), service.retain ? "yes" : "no",
               std::to_string(service.subscribers), service.metadata});
  }
  return table.text(paint);
}

}  // namespace

ExitCode run_services(ToolSession& session) {
  if (const auto ending = session.join_to_look()) return *ending;
  const auto services = session.node().services(session.options().target);
  if (!services) return session.fail(services.failure());
  std::vector<NodeRecord> nodes;
  if (!services->empty()) {
    auto found = session.node().nodes("**");  // services are those of nodes with a name
    if (!found) return session.fail(found.failure());
    nodes = std::move(*found);
  }
  const Places places(nodes);
  session.output().write(session.options().json ? json_of(*services, places)
                                                : table_of(*services, places, session.paint()));
  if (services->empty() && !session.options().target.empty())
    return session.fail_unmatched("service");
  return session.finish();
}

ExitCode run_status(ToolSession& session) {
  if (const auto ending = session.join_to_look()) return *ending;
  const auto hub = session.node().hub();
  if (!hub) return session.fail(hub.failure());
  const auto connections = session.node().hub_connections();
  if (!connections) return session.fail(connections.failure());
  const auto shards = session.node().hub_counters();
  if (!shards) return session.fail(shards.failure());
  const HubStatus status{*hub, *shards, *connections};
  session.output().write(session.options().json ? json_of(status)
                                                : text_of(status, session.paint()));
  return session.finish();
}

}  // namespace gimnet::tool
