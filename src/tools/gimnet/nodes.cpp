#include "tools/gimnet/commands.hpp"
#include "tools/gimnet/record_json.hpp"
#include "tools/gimnet/table.hpp"
#include "tools/gimnet/watch_report.hpp"

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

ExitCode run_nodes(Session& session) {
  if (const auto ending = session.join_to_look()) return *ending;
  const Options& options = session.options();
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

}  // namespace gimnet::tool
