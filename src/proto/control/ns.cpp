#include "proto/control/ns.hpp"

#include "proto/control/names.hpp"

// The numbers are the keys in the tables of docs/protocol.md, section 8; what a message writes and
// what it reads stand side by side.

namespace gimnet::proto::ns {
namespace {

/// Heads, keys, lengths and numbers of any record.
constexpr std::size_t kRecordOverhead = 160;
/// Of SERVICE_MOVED: a group in between, repeated.

std::string read_name(Fields& fields, std::uint32_t key, const char* name) {
  return fields.required_text(key, name, kNameBytesMax);
}

template <class Id>
Id read_id(Fields& fields, std::uint32_t key, const char* name) {
  return Id{fields.number<std::uint32_t>(key, name, 0)};
}

template <class Id>
Id read_required_id(Fields& fields, std::uint32_t key, const char* name) {
  return Id{fields.required_number<std::uint32_t>(key, name)};
}

template <class Choice>
Choice read_choice(Fields& fields, std::uint32_t key, const char* name) {
  return static_cast<Choice>(fields.number<std::uint8_t>(key, name, 0));
}

/// For requests, where a hub has to understand the choice.
template <class Choice>
Choice read_known_choice(Fields& fields, std::uint32_t key, const char* name, Choice last) {
  const auto choice = read_choice<Choice>(fields, key, name);
  if (choice <= last) return choice;
  fields.fail(std::string("has an unknown ") + name);
  return Choice{};
}

template <class Choice>
void put_choice(bitestream::Writer& writer, std::uint32_t key, Choice choice) {
  writer.put_u8(key, static_cast<std::uint8_t>(choice));
}

void write_page_request(bitestream::Writer& writer, const std::string& pattern, std::uint32_t after,
                        std::uint32_t records_max) {
  put_clean_text(writer, 3, pattern, kWrittenNameBytesMax);
  if (after != 0) writer.put_u32(4, after);
  if (records_max != kPageRecordsDefault) writer.put_u32(5, records_max);
}

}  // namespace

const char* operation_name(std::uint16_t operation) {
  switch (static_cast<NsOperation>(operation)) {
    case NsOperation::register_name:
      return "register";
    case NsOperation::unregister_name:
      return "unregister";
    case NsOperation::resolve:
      return "resolve";
    case NsOperation::reverse:
      return "reverse";
    case NsOperation::list:
      return "list";
    case NsOperation::advertise:
      return "advertise";
    case NsOperation::withdraw:
      return "withdraw";
    case NsOperation::services:
      return "services";
    case NsOperation::subscribe:
      return "subscribe";
    case NsOperation::unsubscribe:
      return "unsubscribe";
    case NsOperation::let_go:
      return "let_go";
    case NsOperation::watch:
      return "watch";
    case NsOperation::unwatch:
      return "unwatch";
    case NsOperation::watch_taken:
      return "watch_taken";
    default:
      return nullptr;
  }
}

void Resolve::write(bitestream::Writer& writer) const {
  put_clean_text(writer, 3, name, kWrittenNameBytesMax);
}
Resolve Resolve::read(Fields& fields) { return {read_name(fields, 3, "name")}; }

void ResolveAnswer::write(bitestream::Writer& writer) const {
  writer.put_u32(3, node.value());
  if (standing != NameStanding::held) put_choice(writer, 4, standing);
  if (learning) writer.put_bool(kLearningKey, true);
}
ResolveAnswer ResolveAnswer::read(Fields& fields) {
  ResolveAnswer answer;
  answer.node = read_required_id<NodeId>(fields, 3, "node id");
  answer.standing = read_choice<NameStanding>(fields, 4, "standing of a name");
  answer.learning = fields.flag(kLearningKey, "learning", false);
  return answer;
}

void Reverse::write(bitestream::Writer& writer) const { writer.put_u32(3, node.value()); }
Reverse Reverse::read(Fields& fields) { return {read_required_id<NodeId>(fields, 3, "node id")}; }

void ReverseAnswer::write(bitestream::Writer& writer) const {
  put_clean_text(writer, 3, name, kNameBytesMax);
  writer.put_u32(4, node.value());
}
ReverseAnswer ReverseAnswer::read(Fields& fields) {
  ReverseAnswer answer;
  answer.name = fields.text(3, "name", kNameBytesMax);
  answer.node = read_required_id<NodeId>(fields, 4, "node id");
  return answer;
}

void List::write(bitestream::Writer& writer) const {
  write_page_request(writer, pattern, after.value(), records_max);
  if (connected_only) writer.put_bool(6, true);
}
List List::read(Fields& fields) {
  List list;
  list.pattern = fields.text(3, "pattern", kNameBytesMax);
  list.after = read_id<NodeId>(fields, 4, "node id to continue after");
  list.records_max = fields.number<std::uint32_t>(5, "number of records", kPageRecordsDefault);
  list.connected_only = fields.flag(6, "connected only", false);
  return list;
}

std::size_t page_bytes_max(const NodeRecord& record) {
  return kRecordOverhead + record.name.size() + record.hub_name.size() + record.description.size() +
         record.place.size();
}

void write_record(bitestream::Writer& writer, const NodeRecord& record) {
  writer.put_u32(1, record.node.value());
  put_clean_text(writer, 2, record.name, kNameBytesMax);
  writer.put_u16(3, record.hub.value());
  put_clean_text(writer, 4, record.hub_name, kNameBytesMax);
  writer.put_bool(5, record.connected);
  put_clean_text(writer, 6, record.description, kDescriptionBytesMax);
  put_clean_text(writer, 7, record.place, kRemarkBytesMax);
  writer.put_u64(8, record.joined_ms);
  writer.put_u32(9, record.services);
}
NodeRecord read_node_record(Fields& fields) {
  NodeRecord node;
  node.node = read_required_id<NodeId>(fields, 1, "node id");
  node.name = fields.text(2, "name", kNameBytesMax);
  node.hub = HubId{fields.number<std::uint16_t>(3, "hub id", 0)};
  node.hub_name = fields.text(4, "hub name", kNameBytesMax);
  node.connected = fields.flag(5, "connected", false);
  node.description = fields.text(6, "description", kDescriptionBytesMax);
  node.place = fields.text(7, "place", kRemarkBytesMax);
  node.joined_ms = fields.number<std::uint64_t>(8, "time since it joined", 0);
  node.services = fields.number<std::uint32_t>(9, "number of services", 0);
  return node;
}

void ListAnswer::write(bitestream::Writer& writer) const {
  for (const NodeRecord& record : nodes) {
    writer.begin_nested(3);
    write_record(writer, record);
    writer.end_nested();
  }
  writer.put_bool(4, more);
  if (more) writer.put_u32(5, next.value());
}
ListAnswer ListAnswer::read(Fields& fields) {
  ListAnswer answer;
  answer.nodes = fields.records<NodeRecord>(3, "record", read_node_record);
  answer.more = fields.flag(4, "more", false);
  if (answer.more) answer.next = read_required_id<NodeId>(fields, 5, "node id to continue after");
  return answer;
}

void Advertise::write(bitestream::Writer& writer) const {
  put_clean_text(writer, 3, service, kWrittenNameBytesMax);
  writer.put_u32(4, message_type);
  writer.put_u32(5, instance);
  put_choice(writer, 6, direction);
  put_choice(writer, 7, delivery);
  put_clean_text(writer, 8, metadata, kMetadataBytesMax);
  if (window != 0) writer.put_u32(10, window);
  if (retain) writer.put_bool(11, retain);
}
Advertise Advertise::read(Fields& fields) {
  Advertise advertise;
  advertise.service = read_name(fields, 3, "service name");
  advertise.message_type = fields.number<std::uint32_t>(4, "message type", 0);
  advertise.instance = fields.number<std::uint32_t>(5, "instance", 0);
  advertise.direction = read_known_choice(fields, 6, "direction", Direction::accepts);
  advertise.delivery = read_known_choice(fields, 7, "delivery", Delivery::sync);
  advertise.metadata = fields.text(8, "metadata", kMetadataBytesMax);
  advertise.window = fields.number<std::uint32_t>(10, "window", 0);
  advertise.retain = fields.flag(11, "retain", false);
  return advertise;
}

void AdvertiseAnswer::write(bitestream::Writer& writer) const {
  writer.put_u32(3, group.value());
  writer.put_u32(4, subscribers);
}
AdvertiseAnswer AdvertiseAnswer::read(Fields& fields) {
  AdvertiseAnswer answer;
  answer.group = read_required_id<GroupId>(fields, 3, "group id");
  answer.subscribers = fields.number<std::uint32_t>(4, "number of subscribers", 0);
  return answer;
}

void Withdraw::write(bitestream::Writer& writer) const { writer.put_u32(3, group.value()); }
Withdraw Withdraw::read(Fields& fields) {
  return {read_required_id<GroupId>(fields, 3, "group id")};
}

void ServicesRequest::write(bitestream::Writer& writer) const {
  write_page_request(writer, pattern, after.value(), records_max);
  if (missed) writer.put_bool(7, true);
}
ServicesRequest ServicesRequest::read(Fields& fields) {
  ServicesRequest services;
  services.pattern = fields.text(3, "pattern", kNameBytesMax);
  services.after = read_id<GroupId>(fields, 4, "group id to continue after");
  services.records_max = fields.number<std::uint32_t>(5, "number of records", kPageRecordsDefault);
  services.missed = fields.flag(7, "wish for missed messages", false);
  return services;
}

std::size_t page_bytes_max(const ServiceRecord& record) {
  return kRecordOverhead + record.name.size() + record.metadata.size() + record.hub_name.size();
}

void write_record(bitestream::Writer& writer, const ServiceRecord& record) {
  writer.put_u32(1, record.group.value());
  put_clean_text(writer, 2, record.name, kNameBytesMax);
  writer.put_u32(3, record.node.value());
  writer.put_u32(4, record.message_type);
  writer.put_u32(5, record.instance);
  put_choice(writer, 6, record.direction);
  put_choice(writer, 7, record.delivery);
  put_clean_text(writer, 8, record.metadata, kMetadataBytesMax);
  writer.put_u32(9, record.subscribers);
  put_clean_text(writer, 10, record.hub_name, kNameBytesMax);
  if (record.window != 0) writer.put_u32(11, record.window);
  if (record.retain) writer.put_bool(12, record.retain);
  if (record.missed != 0) writer.put_u64(13, record.missed);
  if (record.missed_most != NodeId{}) writer.put_u32(14, record.missed_most.value());
}
ServiceRecord read_service_record(Fields& fields) {
  ServiceRecord service;
  service.group = read_required_id<GroupId>(fields, 1, "group id");
  service.name = fields.text(2, "name", kNameBytesMax);
  service.node = read_id<NodeId>(fields, 3, "node id");
  service.message_type = fields.number<std::uint32_t>(4, "message type", 0);
  service.instance = fields.number<std::uint32_t>(5, "instance", 0);
  service.direction = read_choice<Direction>(fields, 6, "direction");
  service.delivery = read_choice<Delivery>(fields, 7, "delivery");
  service.metadata = fields.text(8, "metadata", kMetadataBytesMax);
  service.subscribers = fields.number<std::uint32_t>(9, "number of subscribers", 0);
  service.hub_name = fields.text(10, "hub name", kNameBytesMax);
  service.window = fields.number<std::uint32_t>(11, "window", 0);
  service.retain = fields.flag(12, "retain", false);
  service.missed = fields.number<std::uint64_t>(13, "number of missed messages", 0);
  service.missed_most = read_id<NodeId>(fields, 14, "node id of the one that missed most");
  return service;
}

void ServicesAnswer::write(bitestream::Writer& writer) const {
  for (const ServiceRecord& record : services) {
    writer.begin_nested(3);
    write_record(writer, record);
    writer.end_nested();
  }
  writer.put_bool(4, more);
  if (more) writer.put_u32(5, next.value());
}
ServicesAnswer ServicesAnswer::read(Fields& fields) {
  ServicesAnswer answer;
  answer.services = fields.records<ServiceRecord>(3, "record", read_service_record);
  answer.more = fields.flag(4, "more", false);
  if (answer.more) answer.next = read_required_id<GroupId>(fields, 5, "group id to continue after");
  return answer;
}

void Subscribe::write(bitestream::Writer& writer) const {
  put_clean_text(writer, 3, name, kWrittenNameBytesMax);
  if (window != 0) writer.put_u32(4, window);
  if (depth != 1) writer.put_u32(5, depth);
  if (rate_hz != 0.0) writer.put_f64(6, rate_hz);
  if (number != 0) writer.put_u8(7, number);
}
Subscribe Subscribe::read(Fields& fields) {
  Subscribe subscribe;
  subscribe.name = read_name(fields, 3, "full service name");
  subscribe.window = fields.number<std::uint32_t>(4, "window", 0);
  subscribe.depth = fields.number<std::uint32_t>(5, "depth", 1);
  subscribe.rate_hz = fields.number<double>(6, "maximal rate", 0.0);
  subscribe.number = fields.number<std::uint8_t>(7, "count number", 0);
  return subscribe;
}

void ServiceState::write_state(bitestream::Writer& writer) const {
  writer.put_u32(4, group.value());
  if (provider.value() != 0) writer.put_u32(5, provider.value());
  if (session != 0) writer.put_u64(6, session);
  writer.put_u32(7, message_type);
  writer.put_u32(8, instance);
  put_choice(writer, 9, delivery);
  if (window != 0) writer.put_u32(10, window);
  if (retain) writer.put_bool(11, retain);
  if (direction != Direction::provides) put_choice(writer, 12, direction);
  if (away) writer.put_bool(13, away);
}
void ServiceState::read_state(Fields& fields) {
  group = read_id<GroupId>(fields, 4, "group id");
  provider = read_id<NodeId>(fields, 5, "provider's node id");
  session = fields.number<std::uint64_t>(6, "provider's session", 0);
  message_type = fields.number<std::uint32_t>(7, "message type", 0);
  instance = fields.number<std::uint32_t>(8, "instance", 0);
  delivery = read_choice<Delivery>(fields, 9, "delivery");
  window = fields.number<std::uint32_t>(10, "window", 0);
  retain = fields.flag(11, "retain", false);
  direction = read_choice<Direction>(fields, 12, "direction");
  away = fields.flag(13, "away", false);
}

void SubscribeAnswer::write(bitestream::Writer& writer) const {
  if (number != 0) writer.put_u8(3, number);
  write_state(writer);
}
SubscribeAnswer SubscribeAnswer::read(Fields& fields) {
  SubscribeAnswer answer;
  answer.number = fields.number<std::uint8_t>(3, "count number", 0);
  answer.read_state(fields);
  return answer;
}

void Unsubscribe::write(bitestream::Writer& writer) const {
  put_clean_text(writer, 3, name, kWrittenNameBytesMax);
}
Unsubscribe Unsubscribe::read(Fields& fields) {
  return {read_name(fields, 3, "full service name")};
}

void ServiceMoved::write(bitestream::Writer& writer) const {
  put_clean_text(writer, 3, name, kWrittenNameBytesMax);
  write_state(writer);
}
ServiceMoved ServiceMoved::read(Fields& fields) {
  ServiceMoved moved;
  moved.name = read_name(fields, 3, "full service name");
  moved.read_state(fields);
  return moved;
}

void Subscribers::write(bitestream::Writer& writer) const {
  writer.put_u32(3, group.value());
  writer.put_u32(4, subscribers);
}
Subscribers Subscribers::read(Fields& fields) {
  Subscribers read;
  read.group = read_required_id<GroupId>(fields, 3, "group id");
  read.subscribers = fields.number<std::uint32_t>(4, "number of subscribers", 0);
  return read;
}

}  // namespace gimnet::proto::ns
