#include "tools/gimnet/commands.hpp"
#include "tools/gimnet/json_writer.hpp"
#include "tools/gimnet/table.hpp"

namespace gimnet::tool {
namespace {

std::string json_of(const std::vector<NodeRecord>& nodes) {
  JsonWriter json;
  json.begin_array();
  for (const NodeRecord& node : nodes) {
    json.begin_object().member("id", node.node.text()).member("name", node.name);
    json.member("hub", node.hub_name).member("hub_id", node.hub_id).member("connected", node.connected);
    json.member("description", node.description).member("place", node.place);
    json.member("joined_ms", node.joined_ms).member("services", node.services).end_object();
  }
  return json.end_array().str() + "\n";
}

std::string table_of(const std::vector<NodeRecord>& nodes) {
  Table table({"ID", "NAME", "HUB", "STATE", "SERVICES", "SINCE", "PLACE", "DESCRIPTION"});
  for (const NodeRecord& node : nodes) {
    table.add({node.node.text(), node.name.empty() ? "-" : node.name, node.hub_name,
               node.connected ? "connected" : "away", std::to_string(node.services),
               std::to_string(node.joined_ms / 1000) + " s", node.place, node.description});
  }
  return table.text();
}

}  // namespace

ExitCode run_nodes(Session& session) {
  if (const auto ending = session.join({})) return *ending;
  const auto nodes = session.node().nodes(session.options().target);
  if (!nodes) return session.fail(nodes.failure());
  session.output().write(session.options().json ? json_of(*nodes) : table_of(*nodes));
  return session.finish();
}

}  // namespace gimnet::tool
