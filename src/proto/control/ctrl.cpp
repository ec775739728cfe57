#include "proto/control/ctrl.hpp"

#include "proto/control/names.hpp"

// The numbers are the keys in the table of docs/protocol.md, section 9; what a message writes and
// what it reads stand side by side.

namespace gimnet::proto::ctrl {
namespace {

/// Heads, keys, lengths and numbers of any record.
constexpr std::size_t kRecordOverhead = 128;
constexpr std::size_t kConnectionOverhead = 192;

std::vector<CounterValue> read_counters(Fields& counters) {
  std::vector<CounterValue> found;
  bitestream::Reader reader = counters.reader();
  while (const auto value = reader.next()) {
    const auto count = value->as<std::uint64_t>();
    if (value->key().is_text() && count)
      found.push_back({std::string(value->key().text()), *count});
  }
  return found;
}

}  // namespace

const char* operation_name(std::uint16_t operation) {
  switch (static_cast<CtrlOperation>(operation)) {
    case CtrlOperation::hub_info:
      return "hub_info";
    case CtrlOperation::statistics:
      return "statistics";
    case CtrlOperation::connections:
      return "connections";
    case CtrlOperation::kick:
      return "kick";
    case CtrlOperation::reassign:
      return "reassign";
    case CtrlOperation::drain:
      return "drain";
    case CtrlOperation::reload:
      return "reload";
    case CtrlOperation::log_level:
      return "log_level";
    case CtrlOperation::hubs:
      return "hubs";
    case CtrlOperation::links:
      return "links";
    case CtrlOperation::link_add:
      return "link_add";
    case CtrlOperation::link_remove:
      return "link_remove";
    case CtrlOperation::link_cost:
      return "link_cost";
  }
  return nullptr;
}

void HubInfoAnswer::write(bitestream::Writer& writer) const {
  writer.put_u16(3, hub.value());
  put_clean_text(writer, 4, hub_name, kNameBytesMax);
  put_clean_text(writer, 5, version, kRemarkBytesMax);
  writer.put_u32(6, shards);
  writer.put_u64(7, uptime_ms);
  writer.put_u32(8, nodes);
  writer.put_u32(9, services);
}
HubInfoAnswer HubInfoAnswer::read(Fields& fields) {
  HubInfoAnswer answer;
  answer.hub = HubId{fields.required_number<std::uint16_t>(3, "hub id")};
  answer.hub_name = fields.text(4, "hub name", kNameBytesMax);
  answer.version = fields.text(5, "version", kRemarkBytesMax);
  answer.shards = fields.number<std::uint32_t>(6, "number of shards", 0);
  answer.uptime_ms = fields.number<std::uint64_t>(7, "uptime", 0);
  answer.nodes = fields.number<std::uint32_t>(8, "number of nodes", 0);
  answer.services = fields.number<std::uint32_t>(9, "number of services", 0);
  return answer;
}

void StatisticsAnswer::write(bitestream::Writer& writer) const {
  for (const ShardRecord& record : shards) {
    writer.begin_nested(3);
    writer.put_u16(1, record.shard);
    writer.begin_nested(2);
    for (const CounterValue& counter : record.counters)
      writer.put_u64(std::string_view(counter.name), counter.value);
    writer.end_nested();
    writer.end_nested();
  }
}
StatisticsAnswer StatisticsAnswer::read(Fields& fields) {
  StatisticsAnswer answer;
  answer.shards = fields.records<ShardRecord>(3, "shard record", [](Fields& record) {
    ShardRecord shard;
    shard.shard = record.required_number<std::uint16_t>(1, "shard");
    const auto counters = record.records<std::vector<CounterValue>>(2, "counters", read_counters);
    for (const auto& some : counters)
      shard.counters.insert(shard.counters.end(), some.begin(), some.end());
    return shard;
  });
  return answer;
}

void Connections::write(bitestream::Writer& writer) const {
  if (after.value() != 0) writer.put_u32(4, after.value());
  if (records_max != kPageRecordsDefault) writer.put_u32(5, records_max);
}
Connections Connections::read(Fields& fields) {
  Connections connections;
  connections.after = NodeId{fields.number<std::uint32_t>(4, "node id to continue after", 0)};
  connections.records_max =
      fields.number<std::uint32_t>(5, "number of records", kPageRecordsDefault);
  return connections;
}

std::size_t page_bytes_max(const ConnectionRecord& record) {
  return kConnectionOverhead + record.name.size() + record.transport.size() + record.peer.size();
}

void ConnectionsAnswer::write(bitestream::Writer& writer) const {
  for (const ConnectionRecord& record : connections) {
    writer.begin_nested(3);
    writer.put_u32(1, record.node.value());
    put_clean_text(writer, 2, record.name, kNameBytesMax);
    writer.put_u16(3, record.shard);
    put_clean_text(writer, 4, record.transport, kRemarkBytesMax);
    put_clean_text(writer, 5, record.peer, kRemarkBytesMax);
    writer.put_bool(6, record.connected);
    writer.put_u64(7, record.counts.queued_bytes);
    writer.put_u64(8, record.counts.accepted);
    writer.put_u64(9, record.counts.received_bytes);
    writer.put_u64(10, record.counts.delivered);
    writer.put_u64(11, record.counts.sent_bytes);
    writer.put_u64(12, record.counts.dropped);
    if (record.counts.missed != 0) writer.put_u64(13, record.counts.missed);
    if (record.counts.queue_full != 0) writer.put_u64(14, record.counts.queue_full);
    writer.end_nested();
  }
  writer.put_bool(4, more);
}
ConnectionsAnswer ConnectionsAnswer::read(Fields& fields) {
  ConnectionsAnswer answer;
  answer.connections = fields.records<ConnectionRecord>(3, "record", [](Fields& record) {
    ConnectionRecord connection;
    connection.node = NodeId{record.required_number<std::uint32_t>(1, "node id")};
    connection.name = record.text(2, "name", kNameBytesMax);
    connection.shard = record.number<std::uint16_t>(3, "shard", 0);
    connection.transport = record.text(4, "transport", kRemarkBytesMax);
    connection.peer = record.text(5, "peer", kRemarkBytesMax);
    connection.connected = record.flag(6, "connected", false);
    connection.counts.queued_bytes = record.number<std::uint64_t>(7, "number of queued bytes", 0);
    connection.counts.accepted = record.number<std::uint64_t>(8, "number of accepted frames", 0);
    connection.counts.received_bytes =
        record.number<std::uint64_t>(9, "number of received bytes", 0);
    connection.counts.delivered = record.number<std::uint64_t>(10, "number of delivered frames", 0);
    connection.counts.sent_bytes = record.number<std::uint64_t>(11, "number of sent bytes", 0);
    connection.counts.dropped = record.number<std::uint64_t>(12, "number of dropped frames", 0);
    connection.counts.missed = record.number<std::uint64_t>(13, "number of missed messages", 0);
    connection.counts.queue_full =
        record.number<std::uint64_t>(14, "number of frames for a full queue", 0);
    return connection;
  });
  answer.more = fields.flag(4, "more", false);
  return answer;
}

void Kick::write(bitestream::Writer& writer) const {
  writer.put_u32(3, node.value());
  put_clean_text(writer, 4, reason, kRemarkBytesMax);
}
Kick Kick::read(Fields& fields) {
  Kick kick;
  kick.node = NodeId{fields.required_number<std::uint32_t>(3, "node id")};
  kick.reason = fields.text(4, "reason", kRemarkBytesMax);
  return kick;
}

void KickAnswer::write(bitestream::Writer& writer) const {
  put_clean_text(writer, 3, remark, kSentenceBytesMax);
}
KickAnswer KickAnswer::read(Fields& fields) {
  return {fields.text(3, "remark", kSentenceBytesMax)};
}

void Reassign::write(bitestream::Writer& writer) const {
  writer.put_u32(3, node.value());
  writer.put_u32(4, new_node.value());
}
Reassign Reassign::read(Fields& fields) {
  Reassign reassign;
  reassign.node = NodeId{fields.required_number<std::uint32_t>(3, "node id")};
  reassign.new_node = NodeId{fields.required_number<std::uint32_t>(4, "new node id")};
  return reassign;
}

std::size_t page_bytes_max(const ChangeRecord& record) {
  return kRecordOverhead + record.key.size() + record.from.size() + record.to.size();
}

void ReloadAnswer::write(bitestream::Writer& writer) const {
  for (const ChangeRecord& record : changes) {
    writer.begin_nested(3);
    put_clean_text(writer, 1, record.key, kRemarkBytesMax);
    put_clean_text(writer, 2, record.from, kRemarkBytesMax);
    put_clean_text(writer, 3, record.to, kRemarkBytesMax);
    writer.put_bool(4, record.needs_restart);
    writer.end_nested();
  }
  writer.put_bool(4, more);
}
ReloadAnswer ReloadAnswer::read(Fields& fields) {
  ReloadAnswer answer;
  answer.changes = fields.records<ChangeRecord>(3, "record", [](Fields& record) {
    ChangeRecord change;
    change.key = record.required_text(1, "key", kRemarkBytesMax);
    change.from = record.text(2, "value before", kRemarkBytesMax);
    change.to = record.text(3, "value now", kRemarkBytesMax);
    change.needs_restart = record.flag(4, "need of a restart", false);
    return change;
  });
  answer.more = fields.flag(4, "more", false);
  return answer;
}

void SetLogLevel::write(bitestream::Writer& writer) const {
  put_clean_text(writer, 3, level, kRemarkBytesMax);
}
SetLogLevel SetLogLevel::read(Fields& fields) {
  return {fields.required_text(3, "level", kRemarkBytesMax)};
}

void SetLogLevelAnswer::write(bitestream::Writer& writer) const {
  put_clean_text(writer, 3, before, kRemarkBytesMax);
}
SetLogLevelAnswer SetLogLevelAnswer::read(Fields& fields) {
  return {fields.text(3, "level before", kRemarkBytesMax)};
}

}  // namespace gimnet::proto::ctrl
