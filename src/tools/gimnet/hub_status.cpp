#include "tools/gimnet/hub_status.hpp"

#include <algorithm>

#include "tools/gimnet/json_writer.hpp"
#include "tools/gimnet/table.hpp"

namespace gimnet::tool {
namespace {

constexpr std::string_view kDropped = "dropped.";
constexpr std::string_view kRefused = "refused.";

std::uint64_t value_of(const Counters& counters, std::string_view name) {
  const auto found = std::ranges::find(
      counters, name, [](const auto& counter) { return std::string_view(counter.first); });
  return found == counters.end() ? 0 : found->second;
}

void write(JsonWriter& json, const Counters& counters) {
  json.begin_object();
  // What waits is counted up on one shard and down on another: only the sum has to be above 0.
  for (const auto& [name, value] : counters) json.member(name, static_cast<std::int64_t>(value));
  json.end_object();
}

void write_parts(JsonWriter& json, const Ledger& ledger) {
  json.begin_object().member("accepted", ledger.accepted).member("copies", ledger.copies);
  json.member("delivered", ledger.delivered)
      .member("dropped", ledger.dropped)
      .member("queued", static_cast<std::int64_t>(ledger.queued));
}

void write(JsonWriter& json, const Ledger& ledger) {
  write_parts(json, ledger);
  json.member("exact", ledger.exact()).end_object();
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
    json.member("dropped", connection.dropped).end_object();
  }
  json.end_array();
}

std::string connections_table(const std::vector<ConnectionRecord>& connections, Paint paint) {
  Table table({"ID", "NAME", "SHARD", "TRANSPORT", "STATE", "ACCEPTED", "DELIVERED", "DROPPED",
               "QUEUED", "PEER"});
  for (const ConnectionRecord& connection : connections) {
    table.add({connection.node.text(), connection.name.empty() ? "-" : connection.name,
               std::to_string(connection.shard), connection.transport,
               connection.connected ? "connected" : "away", std::to_string(connection.accepted),
               std::to_string(connection.delivered), std::to_string(connection.dropped),
               std::to_string(connection.queued_bytes), connection.peer},
              connection.connected ? Tone::plain : Tone::warning);
  }
  return table.text(paint);
}

}  // namespace

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
  Ledger ledger{value_of(counters, "accepted"), value_of(counters, "copies"),
                value_of(counters, "delivered"), 0, value_of(counters, "queued")};
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

std::string json_of(const HubStatus& status) {
  const Counters counters = summed(status.shards);
  JsonWriter json;
  json.begin_object();
  write(json.key("hub"), status.hub);
  write(json.key("ledger"), ledger_of(counters));
  write(json.key("counters"), counters);
  write(json.key("shards"), status.shards);
  write(json.key("connections"), status.connections);
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
  text += "ledger: " + std::to_string(ledger.accepted) + " accepted + " +
          std::to_string(ledger.copies) + " copies = " + std::to_string(ledger.delivered) +
          " delivered + " + std::to_string(ledger.dropped) + " dropped + " +
          std::to_string(ledger.queued) + " queued" +
          (ledger.exact() ? "\n" : " (not balanced: frames are on their way)\n");
  for (const auto& [name, value] : counters) {
    if (name.starts_with(kDropped) && value != 0)
      text += paint("  " + name + ": " + std::to_string(value), Tone::bad) + "\n";
  }
  text += "mailbox: " + std::to_string(value_of(counters, "mailbox_entries")) + " entries, " +
          std::to_string(value_of(counters, "mailbox_wakeups")) + " wake-ups\n";
  for (const auto& [name, value] : counters) {
    if (name.starts_with(kRefused) && value != 0)
      text += name + ": " + std::to_string(value) + "\n";
  }
  return text + "\n" + connections_table(status.connections, paint);
}

}  // namespace gimnet::tool
