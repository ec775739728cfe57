#include <cstdint>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "tools/gimnet/commands.hpp"
#include "tools/gimnet/record_json.hpp"
#include "tools/gimnet/table.hpp"

namespace gimnet::tool {
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

ExitCode run_services(Session& session) {
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

}  // namespace gimnet::tool
