#include "proto/control/ctrl_network.hpp"

#include "base/endian.hpp"
#include "proto/control/names.hpp"

// The numbers are the keys in the table of docs/protocol.md, section 9.

namespace gimnet::proto::ctrl {
namespace {

/// Heads, keys, lengths and numbers of a record.
constexpr std::size_t kHubOverhead = 160;
constexpr std::size_t kLinkOverhead = 256;
constexpr std::size_t kEdgeSize = 4;

std::vector<std::byte> bytes_of(const std::vector<HubEdge>& edges) {
  std::vector<std::byte> bytes(std::min(edges.size(), kHubEdgesMax) * kEdgeSize);
  for (std::size_t i = 0; i * kEdgeSize < bytes.size(); ++i) {
    store_le(bytes.data() + i * kEdgeSize, edges[i].hub.value());
    store_le(bytes.data() + i * kEdgeSize + 2, edges[i].cost);
  }
  return bytes;
}

std::vector<HubEdge> read_edges(Fields& record) {
  const auto bytes = record.opaque(11, "list of links", kHubEdgesMax * kEdgeSize);
  if (bytes.size() % kEdgeSize != 0) record.fail("has a list of links that is cut");
  std::vector<HubEdge> edges;
  for (std::size_t at = 0; at + kEdgeSize <= bytes.size(); at += kEdgeSize) {
    edges.push_back({HubId{load_le<std::uint16_t>(bytes.data() + at)},
                     load_le<std::uint16_t>(bytes.data() + at + 2)});
  }
  return edges;
}

}  // namespace

void Hubs::write(bitestream::Writer& writer) const {
  if (after.value() != 0) writer.put_u16(4, after.value());
  if (records_max != kPageRecordsDefault) writer.put_u32(5, records_max);
}
Hubs Hubs::read(Fields& fields) {
  Hubs hubs;
  hubs.after = HubId{fields.number<std::uint16_t>(4, "hub id to continue after", 0)};
  hubs.records_max = fields.number<std::uint32_t>(5, "number of records", kPageRecordsDefault);
  return hubs;
}

std::size_t page_bytes_max(const HubRecord& record) {
  return kHubOverhead + record.hub_name.size() + record.version.size() +
         record.edges.size() * kEdgeSize;
}

void HubsAnswer::write(bitestream::Writer& writer) const {
  for (const HubRecord& record : hubs) {
    writer.begin_nested(3);
    writer.put_u16(1, record.hub.value());
    put_clean_text(writer, 2, record.hub_name, kNameBytesMax);
    writer.put_u16(3, record.next_hop.value());
    writer.put_u32(4, record.cost);
    writer.put_u32(5, record.nodes);
    writer.put_u32(6, record.services);
    writer.put_u16(7, record.distance);
    writer.put_bool(8, record.reachable);
    writer.put_bool(9, record.too_far);
    put_clean_text(writer, 10, record.version, kRemarkBytesMax);
    writer.put_opaque(11, bytes_of(record.edges));
    writer.end_nested();
  }
  writer.put_bool(4, more);
}
HubsAnswer HubsAnswer::read(Fields& fields) {
  HubsAnswer answer;
  answer.hubs = fields.records<HubRecord>(3, "record", [](Fields& record) {
    HubRecord hub;
    hub.hub = HubId{record.required_number<std::uint16_t>(1, "hub id")};
    hub.hub_name = record.text(2, "hub name", kNameBytesMax);
    hub.next_hop = HubId{record.number<std::uint16_t>(3, "next hop", 0)};
    hub.cost = record.number<std::uint32_t>(4, "cost", 0);
    hub.nodes = record.number<std::uint32_t>(5, "number of nodes", 0);
    hub.services = record.number<std::uint32_t>(6, "number of services", 0);
    hub.distance = record.number<std::uint16_t>(7, "distance", 0);
    hub.reachable = record.flag(8, "reachable", true);
    hub.too_far = record.flag(9, "too far", false);
    hub.version = record.text(10, "version", kRemarkBytesMax);
    hub.edges = read_edges(record);
    return hub;
  });
  answer.more = fields.flag(4, "more", false);
  return answer;
}

void LinksRequest::write(bitestream::Writer& writer) const {
  if (skip != 0) writer.put_u32(4, skip);
  if (records_max != kPageRecordsDefault) writer.put_u32(5, records_max);
}
LinksRequest LinksRequest::read(Fields& fields) {
  LinksRequest links;
  links.skip = fields.number<std::uint32_t>(4, "number of records to skip", 0);
  links.records_max = fields.number<std::uint32_t>(5, "number of records", kPageRecordsDefault);
  return links;
}

const char* link_state_name(LinkState state) {
  switch (state) {
    case LinkState::dialling:
      return "dialling";
    case LinkState::away:
      return "away";
    case LinkState::learning:
      return "learning";
    case LinkState::standby:
      return "standby";
    case LinkState::damped:
      return "damped";
    case LinkState::up:
      return "up";
    case LinkState::ended:
      return "ended";
  }
  return "unknown";
}

std::size_t page_bytes_max(const LinkRecord& record) {
  return kLinkOverhead + record.name.size() + record.peer.size() + record.last_error.size();
}

void LinksAnswer::write(bitestream::Writer& writer) const {
  for (const LinkRecord& record : links) {
    const LinkCounts& counts = record.counts;
    writer.begin_nested(3);
    put_clean_text(writer, 1, record.name, kNameBytesMax);
    writer.put_u16(2, record.hub.value());
    put_clean_text(writer, 3, record.peer, kRemarkBytesMax);
    writer.put_u16(4, static_cast<std::uint16_t>(record.state));
    writer.put_bool(5, record.dialled);
    writer.put_u16(6, record.cost);
    writer.put_u32(7, record.rtt_us);
    writer.put_i64(8, record.clock_offset_ns);
    writer.put_u64(9, record.clock_error_ns);
    writer.put_u64(10, counts.queued_bytes);
    writer.put_u64(11, counts.sent_bytes);
    writer.put_u64(12, counts.received_bytes);
    writer.put_u64(13, counts.accepted);
    writer.put_u64(14, counts.delivered);
    writer.put_u64(15, counts.dropped);
    writer.put_u64(16, counts.unsure);
    if (!record.last_error.empty())
      put_clean_text(writer, 17, record.last_error, kSentenceBytesMax);
    if (counts.queue_full != 0) writer.put_u64(18, counts.queue_full);
    writer.end_nested();
  }
  writer.put_bool(4, more);
}
LinksAnswer LinksAnswer::read(Fields& fields) {
  LinksAnswer answer;
  answer.links = fields.records<LinkRecord>(3, "record", [](Fields& record) {
    LinkRecord link;
    link.name = record.required_text(1, "name", kNameBytesMax);
    link.hub = HubId{record.number<std::uint16_t>(2, "hub id", 0)};
    link.peer = record.text(3, "peer", kRemarkBytesMax);
    link.state = LinkState{record.number<std::uint16_t>(4, "state", 0)};
    link.dialled = record.flag(5, "dialled", false);
    link.cost = record.number<std::uint16_t>(6, "cost", 0);
    link.rtt_us = record.number<std::uint32_t>(7, "round trip", 0);
    link.clock_offset_ns = record.number<std::int64_t>(8, "clock offset", 0);
    link.clock_error_ns = record.number<std::uint64_t>(9, "error of the clock offset", 0);
    link.counts.queued_bytes = record.number<std::uint64_t>(10, "number of queued bytes", 0);
    link.counts.sent_bytes = record.number<std::uint64_t>(11, "number of sent bytes", 0);
    link.counts.received_bytes = record.number<std::uint64_t>(12, "number of received bytes", 0);
    link.counts.accepted = record.number<std::uint64_t>(13, "number of accepted frames", 0);
    link.counts.delivered = record.number<std::uint64_t>(14, "number of delivered frames", 0);
    link.counts.dropped = record.number<std::uint64_t>(15, "number of dropped frames", 0);
    link.counts.unsure = record.number<std::uint64_t>(16, "number of unsure frames", 0);
    link.last_error = record.text(17, "last error", kSentenceBytesMax);
    link.counts.queue_full =
        record.number<std::uint64_t>(18, "number of frames for a full queue", 0);
    return link;
  });
  answer.more = fields.flag(4, "more", false);
  return answer;
}

void LinkAdd::write(bitestream::Writer& writer) const {
  put_clean_text(writer, 3, url, kWrittenNameBytesMax);
  if (!name.empty()) put_clean_text(writer, 4, name, kWrittenNameBytesMax);
  if (cost != 0) writer.put_u16(5, cost);
  if (!proxy.empty()) put_clean_text(writer, 6, proxy, kWrittenNameBytesMax);
}
LinkAdd LinkAdd::read(Fields& fields) {
  return {fields.required_text(3, "URL", kWrittenNameBytesMax),
          fields.text(4, "name", kWrittenNameBytesMax), fields.number<std::uint16_t>(5, "cost", 0),
          fields.text(6, "proxy", kWrittenNameBytesMax)};
}

void LinkRemove::write(bitestream::Writer& writer) const {
  put_clean_text(writer, 3, name, kWrittenNameBytesMax);
}
LinkRemove LinkRemove::read(Fields& fields) {
  return {fields.required_text(3, "name", kWrittenNameBytesMax)};
}

void SetLinkCost::write(bitestream::Writer& writer) const {
  put_clean_text(writer, 3, name, kWrittenNameBytesMax);
  if (cost != 0) writer.put_u16(4, cost);
}
SetLinkCost SetLinkCost::read(Fields& fields) {
  return {fields.required_text(3, "name", kWrittenNameBytesMax),
          fields.number<std::uint16_t>(4, "cost", 0)};
}

}  // namespace gimnet::proto::ctrl
