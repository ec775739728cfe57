#include "tools/gimnet/hub_status.hpp"

#include <algorithm>
#include <functional>
#include <unordered_map>

#include "tools/gimnet/json_writer.hpp"
#include "tools/gimnet/member_status.hpp"
#include "tools/gimnet/missed_afar.hpp"
#include "tools/gimnet/network.hpp"
#include "tools/gimnet/session.hpp"
#include "tools/gimnet/table.hpp"
#include "tools/gimnet/watch.hpp"

namespace gimnet::tool {
namespace {

constexpr std::string_view kDropped = "dropped.";
constexpr std::string_view kQueueFull = "dropped.queue_full";
constexpr std::string_view kRefused = "refused.";
constexpr std::string_view kLinks = "links.";

std::uint64_t value_of(const Counters& counters, std::string_view name) {
  const auto found = std::ranges::find(
      counters, name, [](const auto& counter) { return std::string_view(counter.first); });
  return found == counters.end() ? 0 : found->second;
}

void write(JsonWriter& json, const Counters& counters) {
  json.begin_object();
  // `queued` is counted up on one shard and down on another: only the sum has to be above 0.
  for (const auto& [name, value] : counters) json.member(name, static_cast<std::int64_t>(value));
  json.end_object();
}

void write_parts(JsonWriter& json, const Ledger& ledger) {
  json.begin_object().member("accepted", ledger.accepted).member("copies", ledger.copies);
  json.member("delivered", ledger.delivered)
      .member("dropped", ledger.dropped)
      .member("queued", static_cast<std::int64_t>(ledger.queued));
}

void write(JsonWriter& json, const HubRecord& hub) {
  json.begin_object()
      .member("id", hub.hub_id)
      .member("name", hub.name)
      .member("version", hub.version);
  json.member("shards", hub.shards).member("uptime_ms", hub.uptime_ms).member("nodes", hub.nodes);
  json.member("services", hub.services).end_object();
}

void write(JsonWriter& json, const std::vector<ShardCounts>& shards) {
  json.begin_array();
  for (const ShardCounts& shard : shards) {
    if (shard.shard == ShardCounts::kConductor) continue;  // no shard; the sums have it
    json.begin_object().member("shard", shard.shard);
    // Frames go from one shard to another: only the sum can be exact.
    write_parts(json.key("ledger"), ledger_of(shard.counters));
    json.end_object();
    write(json.key("counters"), shard.counters);
    json.end_object();
  }
  json.end_array();
}

void write(JsonWriter& json, const std::vector<ConnectionRecord>& connections) {
  json.begin_array();
  for (const ConnectionRecord& connection : connections) {
    json.begin_object().member("id", connection.node.text()).member("name", connection.name);
    json.member("shard", connection.shard)
        .member("transport", connection.transport)
        .member("peer", connection.peer);
    json.member("connected", connection.connected).member("queued_bytes", connection.queued_bytes);
    json.member("accepted", connection.accepted)
        .member("received_bytes", connection.received_bytes);
    json.member("delivered", connection.delivered).member("sent_bytes", connection.sent_bytes);
    json.member("dropped", connection.dropped).member("missed", connection.missed);
    json.member("queue_full", connection.queue_full).end_object();
  }
  json.end_array();
}

std::string connections_table(const std::vector<ConnectionRecord>& connections, Paint paint) {
  Table table({"ID", "NAME", "SHARD", "TRANSPORT", "STATE", "ACCEPTED", "DELIVERED", "DROPPED",
               "MISSED", "QUEUED", "PEER"});
  for (const ConnectionRecord& connection : connections) {
    table.add({connection.node.text(), connection.name.empty() ? "-" : connection.name,
               std::to_string(connection.shard), connection.transport,
               connection.connected ? "connected" : "away", std::to_string(connection.accepted),
               std::to_string(connection.delivered), std::to_string(connection.dropped),
               std::to_string(connection.missed), std::to_string(connection.queued_bytes),
               connection.peer},
              connection.connected ? Tone::plain : Tone::warning);
  }
  return table.text(paint);
}

}  // namespace

void write(JsonWriter& json, const Ledger& ledger) {
  write_parts(json, ledger);
  json.member("exact", ledger.exact()).end_object();
}

std::string text_of(const Ledger& ledger) {
  return "ledger: " + std::to_string(ledger.accepted) + " accepted + " +
         std::to_string(ledger.copies) + " copies = " + std::to_string(ledger.delivered) +
         " delivered + " + std::to_string(ledger.dropped - ledger.wrong_way) + " dropped + " +
         (ledger.wrong_way == 0 ? "" : std::to_string(ledger.wrong_way) + " by another way + ") +
         std::to_string(ledger.queued) + " queued" +
         (ledger.exact() ? "" : " (not balanced: frames are on their way)");
}

Counters summed(const std::vector<ShardCounts>& shards) {
  Counters sums;
  for (const ShardCounts& shard : shards) {
    for (const auto& [name, value] : shard.counters) {
      const auto sum = std::ranges::find(sums, name, &Counters::value_type::first);
      if (sum == sums.end()) {
        sums.emplace_back(name, value);
      } else {
        sum->second = name.ends_with("_max") ? std::max(sum->second, value) : sum->second + value;
      }
    }
  }
  return sums;
}

Ledger ledger_of(const Counters& counters) {
  Ledger ledger{value_of(counters, "accepted"),  value_of(counters, "copies"),
                value_of(counters, "delivered"), 0,
                value_of(counters, "queued"),    value_of(counters, "dropped.wrong_way")};
  for (const auto& [name, value] : counters) {
    if (name.starts_with(kDropped)) ledger.dropped += value;
  }
  return ledger;
}

std::string json_of(const std::vector<ConnectionRecord>& connections) {
  JsonWriter json;
  write(json, connections);
  return json.str() + "\n";
}

std::string text_of(const std::vector<ConnectionRecord>& connections, Paint paint) {
  return connections_table(connections, paint);
}

namespace {

/// So many nodes and links with full queues are named: those that lost most.
constexpr std::size_t kFullNamed = 10;

/// The nodes and links whose full queues cost frames, those that lost most first.
std::string full_queues(const HubStatus& status, std::uint64_t all) {
  std::vector<std::pair<std::uint64_t, std::string>> full;
  for (const ConnectionRecord& each : status.connections)
    full.emplace_back(each.queue_full,
                      "node " + each.node.text() + (each.name.empty() ? "" : " " + each.name));
  for (const LinkRecord& each : status.links)
    full.emplace_back(each.queue_full,
                      "link " + each.name + " to hub " + std::to_string(each.hub_id));
  std::erase_if(full, [](const auto& each) { return each.first == 0; });
  if (full.empty()) return "";  // all have left, or the hub is older
  std::ranges::stable_sort(full, std::greater{}, [](const auto& each) { return each.first; });
  std::string text;
  std::uint64_t of_others = 0;
  for (std::size_t i = 0; i < full.size(); ++i) {
    const auto& [frames, who] = full[i];
    all -= std::min(all, frames);
    if (i < kFullNamed) {
      text += "    for " + printable(who) + ": " + std::to_string(frames) + "\n";
    } else {
      of_others += frames;
    }
  }
  if (full.size() > kFullNamed) {
    text += "    for " + std::to_string(full.size() - kFullNamed) +
            " others (--json names them): " + std::to_string(of_others) + "\n";
  }
  return all == 0 ? text : text + "    for others that have left: " + std::to_string(all) + "\n";
}

}  // namespace

std::string json_of(const HubStatus& status) {
  const Counters counters = summed(status.shards);
  JsonWriter json;
  json.begin_object();
  write(json.key("hub"), status.hub);
  write(json.key("ledger"), ledger_of(counters));
  write(json.key("counters"), counters);
  write(json.key("shards"), status.shards);
  write(json.key("connections"), status.connections);
  write(json.key("links"), status.links);
  return json.end_object().str() + "\n";
}

std::string text_of(const HubStatus& status, Paint paint) {
  const Counters counters = summed(status.shards);
  const Ledger ledger = ledger_of(counters);
  std::string text =
      "hub " + std::to_string(status.hub.hub_id) + " " + status.hub.name + ", version " +
      status.hub.version + ", up " + std::to_string(status.hub.uptime_ms / 1000) + " s, " +
      std::to_string(status.hub.shards) + " shards, " + std::to_string(status.hub.nodes) +
      " nodes, " + std::to_string(status.hub.services) + " services\n";
  text += text_of(ledger) + "\n";
  for (const auto& [name, value] : counters) {
    if (!name.starts_with(kDropped) || value == 0) continue;
    text += paint("  " + name + ": " + std::to_string(value), Tone::bad) + "\n";
    if (name == kQueueFull) text += full_queues(status, value);
  }
  text += "mailbox: " + std::to_string(value_of(counters, "mailbox_entries")) + " entries, " +
          std::to_string(value_of(counters, "mailbox_wakeups")) + " wake-ups\n";
  for (const auto& [name, value] : counters) {
    if ((name.starts_with(kRefused) || name.starts_with(kLinks)) && value != 0)
      text += name + ": " + std::to_string(value) + "\n";
  }
  return text + "\n" + connections_table(status.connections, paint);
}

namespace {

std::string json_of(const std::vector<NodeRecord>& nodes, ToolSession& session) {
  JsonWriter json;
  json.begin_array();
  for (const NodeRecord& node : nodes) write(json, node, session.standing_of(node));
  return json.end_array().str() + "\n";
}

std::string table_of(const std::vector<NodeRecord>& nodes, ToolSession& session) {
  Table table({"ID", "NAME", "HUB", "STATE", "SERVICES", "SINCE", "PLACE", "DESCRIPTION"});
  const auto own_hub = hub_of(NodeId{session.node().peer().id}).value();
  for (const NodeRecord& node : nodes) {
    // A hub knows no more than names and states of another hub's nodes.
    const bool own = node.hub_id == own_hub;
    table.add({node.node.text(), node.name.empty() ? "-" : node.name, node.hub_name,
               std::string(session.standing_of(node)), own ? std::to_string(node.services) : "-",
               own ? std::to_string(node.joined_ms / 1000) + " s" : "-", own ? node.place : "-",
               node.description},
              node.connected ? Tone::plain : Tone::warning);
  }
  return table.text(session.paint());
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
  session.output().write(options.json ? json_of(*nodes, session) : table_of(*nodes, session));
  if (nodes->empty() && !options.target.empty()) return session.fail_unmatched("node");
  return session.finish();
}

namespace {

/// Places and states of the nodes that have services. A node that came or went between the two
/// listings has neither.
class ProviderIndex {
 public:
  ProviderIndex(const std::vector<NodeRecord>& nodes, ToolSession& session) {
    for (const NodeRecord& node : nodes)
      by_id_[node.node.id] = {node.place, session.standing_of(node)};
  }
  [[nodiscard]] Provider of(Peer node) const {
    const auto found = by_id_.find(node.id);
    return found == by_id_.end() ? Provider{} : found->second;
  }

 private:
  std::unordered_map<std::uint32_t, Provider> by_id_;
};

std::string json_of(const std::vector<ServiceRecord>& services, const ProviderIndex& providers) {
  JsonWriter json;
  json.begin_array();
  for (const ServiceRecord& service : services) write(json, service, providers.of(service.node));
  return json.end_array().str() + "\n";
}

/// The application's numbers of its messages; those of requests are the library's.
std::string type_of(const ServiceRecord& service) {
  if (service.answers()) return "-";
  return std::to_string(service.key.type) + "/" + std::to_string(service.key.instance);
}

/// The messages that its subscribers missed, and who missed most of them.
std::string missed_of(const ServiceRecord& service) {
  std::string words = std::to_string(service.missed);
  if (service.missed != 0) words += " (most: " + service.missed_most.text() + ")";
  return words;
}

std::string table_of(const std::vector<ServiceRecord>& services, const ProviderIndex& providers,
                     Paint paint) {
  Table table({"NAME", "NODE", "HUB", "STATE", "PLACE", "TYPE", "DIRECTION", "DELIVERY", "RETAIN",
               "SUBSCRIBERS", "MISSED", "METADATA"});
  for (const ServiceRecord& service : services) {
    const Provider provider = providers.of(service.node);
    table.add({service.name, service.node.text(), service.hub_name, std::string(provider.state),
               provider.place.empty() ? "-" : std::string(provider.place), type_of(service),
               direction_of(service), delivery_of(service), service.retain ? "yes" : "no",
               std::to_string(service.subscribers), missed_of(service), service.metadata},
              provider.state == "connected" ? Tone::plain : Tone::warning);
  }
  return table.text(paint);
}

}  // namespace

ExitCode run_services(ToolSession& session) {
  if (const auto ending = session.join_to_look()) return *ending;
  auto services = session.node().services(session.options().target);
  if (!services) return session.fail(services.failure());
  add_missed_afar(session, *services);
  std::vector<NodeRecord> nodes;
  if (!services->empty()) {
    auto found = session.node().nodes("**");  // services are those of nodes with a name
    if (!found) return session.fail(found.failure());
    nodes = std::move(*found);
  }
  const ProviderIndex providers(nodes, session);
  session.output().write(session.options().json ? json_of(*services, providers)
                                                : table_of(*services, providers, session.paint()));
  if (services->empty() && !session.options().target.empty())
    return session.fail_unmatched("service");
  return session.finish();
}

ExitCode run_status(ToolSession& session) {
  if (const auto ending = session.join_to_look()) return *ending;
  if (session.options().all) return run_status_of_all(session);
  const std::uint32_t hub_id = session.options().hub_id;
  const auto hub = session.node().hub(kHubPatience, hub_id);
  if (!hub) return session.fail(hub.failure());
  const auto connections = session.node().hub_connections(kHubPatience, hub_id);
  if (!connections) return session.fail(connections.failure());
  const auto shards = session.node().hub_counters(kHubPatience, hub_id);
  if (!shards) return session.fail(shards.failure());
  const auto links = session.node().hub_links(kHubPatience, hub_id);
  if (!links) return session.fail(links.failure());
  const HubStatus status{*hub, *shards, *connections, *links};
  session.output().write(session.options().json ? json_of(status)
                                                : text_of(status, session.paint()));
  return session.finish();
}

}  // namespace gimnet::tool
