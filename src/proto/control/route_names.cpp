#include "proto/control/route_names.hpp"

#include "base/endian.hpp"
#include "proto/control/names.hpp"

// The numbers are the keys in the tables of docs/protocol.md, section 10.

namespace gimnet::proto::route {
namespace {

// An entry of NAMES_KNOWN on the wire: {u16 hub id, u64 instance, u64 version}.
constexpr std::size_t kInstanceOffset = 2;
constexpr std::size_t kVersionOffset = 10;
constexpr std::size_t kKnownSize = 18;

namespace names_key {
enum : std::uint32_t { hub = 1, instance, after, version, forgotten, record };
}  // namespace names_key

namespace name_key {
enum : std::uint32_t {
  name = 1,
  version,
  node,
  rank,
  state,
  group,
  session,
  message_type,
  instance,
  window,
  direction,
  delivery,
  retain,
  proof,  // reserved
};
}  // namespace name_key

template <class Choice>
Choice read_choice(Fields& fields, std::uint32_t key, const char* name, Choice last) {
  const auto choice = static_cast<Choice>(fields.number<std::uint8_t>(key, name, 0));
  if (choice <= last) return choice;
  fields.fail(std::string("has an unknown ") + name);
  return Choice{};
}

void write_service(bitestream::Writer& writer, const ServiceClaim& service) {
  namespace key = name_key;
  writer.put_u32(key::group, service.group.value());
  writer.put_u64(key::session, service.session);
  writer.put_u32(key::message_type, service.message_type);
  writer.put_u32(key::instance, service.instance);
  if (service.window != 0) writer.put_u32(key::window, service.window);
  writer.put_u8(key::direction, static_cast<std::uint8_t>(service.direction));
  writer.put_u8(key::delivery, static_cast<std::uint8_t>(service.delivery));
  if (service.retain) writer.put_bool(key::retain, true);
}

ServiceClaim read_service(Fields& fields) {
  namespace key = name_key;
  ServiceClaim service;
  service.group = GroupId{fields.required_number<std::uint32_t>(key::group, "group id")};
  service.session = fields.number<std::uint64_t>(key::session, "session", 0);
  service.message_type = fields.number<std::uint32_t>(key::message_type, "message type", 0);
  service.instance = fields.number<std::uint32_t>(key::instance, "instance", 0);
  service.window = fields.number<std::uint32_t>(key::window, "window", 0);
  service.direction = read_choice(fields, key::direction, "direction", ns::Direction::accepts);
  service.delivery = read_choice(fields, key::delivery, "delivery", ns::Delivery::sync);
  service.retain = fields.flag(key::retain, "retain", false);
  return service;
}

void write_name(bitestream::Writer& writer, const NameRecord& record) {
  namespace key = name_key;
  const NameClaim& claim = record.claim;
  put_clean_text(writer, key::name, record.name, kNameBytesMax);
  writer.put_u64(key::version, claim.version);
  if (claim.state != NameState::held)
    writer.put_u8(key::state, static_cast<std::uint8_t>(claim.state));
  if (claim.state == NameState::deleted) return;
  writer.put_u32(key::node, claim.node.value());
  if (claim.rank != kOrdinaryRank) writer.put_u32(key::rank, claim.rank);
  if (claim.service) write_service(writer, *claim.service);
}

NameRecord read_name(Fields& fields) {
  namespace key = name_key;
  NameRecord record;
  NameClaim& claim = record.claim;
  record.name = fields.required_text(key::name, "name", kNameBytesMax);
  if (!fields.failed() && !valid_name(record.name)) fields.fail("has a name that cannot be one");
  claim.version = fields.required_number<std::uint64_t>(key::version, "version");
  claim.state = read_choice(fields, key::state, "state of a name", NameState::deleted);
  if (claim.state == NameState::deleted) return record;
  claim.node = NodeId{fields.required_number<std::uint32_t>(key::node, "node id")};
  claim.rank = fields.number<std::uint32_t>(key::rank, "rank", kOrdinaryRank);
  if (fields.has(key::group)) claim.service = read_service(fields);
  return record;
}

}  // namespace

void NamesKnown::write(bitestream::Writer& writer) const {
  GIMNET_ASSERT(hubs.size() <= kNamesKnownMax);
  std::vector<std::byte> list(hubs.size() * kKnownSize);
  std::byte* next = list.data();
  for (const Entry& each : hubs) {
    store_le(next, each.hub.value());
    store_le(next + kInstanceOffset, each.instance.value());
    store_le(next + kVersionOffset, each.version);
    next += kKnownSize;
  }
  writer.put_opaque(1, list);
}

NamesKnown NamesKnown::read(Fields& fields) {
  NamesKnown known;
  const auto bytes = fields.opaque(1, "list of hubs", kNamesKnownMax * kKnownSize);
  if (bytes.size() % kKnownSize != 0) fields.fail("has a list of hubs that is cut");
  for (std::size_t at = 0; at < bytes.size() && !fields.failed(); at += kKnownSize) {
    const std::byte* entry = bytes.data() + at;
    known.hubs.push_back({HubId{load_le<std::uint16_t>(entry)},
                          HubInstance{load_le<std::uint64_t>(entry + kInstanceOffset)},
                          load_le<std::uint64_t>(entry + kVersionOffset)});
    if (!names_a_hub(known.hubs.back().hub)) fields.fail("has a hub id that is not in 1..4094");
  }
  return known;
}

void Names::write(bitestream::Writer& writer) const {
  namespace key = names_key;
  writer.put_u16(key::hub, hub.value());
  writer.put_u64(key::instance, instance.value());
  if (after != 0) writer.put_u64(key::after, after);
  writer.put_u64(key::version, version);
  if (forgotten != 0) writer.put_u64(key::forgotten, forgotten);
  for (const NameRecord& each : records) {
    writer.begin_nested(key::record);
    write_name(writer, each);
    writer.end_nested();
  }
}

Names Names::read(Fields& fields) {
  namespace key = names_key;
  Names names;
  names.hub = HubId{fields.required_number<std::uint16_t>(key::hub, "hub id")};
  if (!names_a_hub(names.hub)) fields.fail("has a hub id that is not in 1..4094");
  names.instance = HubInstance{fields.required_number<std::uint64_t>(key::instance, "instance")};
  names.after = fields.number<std::uint64_t>(key::after, "version before", 0);
  names.version = fields.required_number<std::uint64_t>(key::version, "version");
  names.forgotten = fields.number<std::uint64_t>(key::forgotten, "version forgotten", 0);
  names.records = fields.records<NameRecord>(key::record, "record", read_name);
  std::uint64_t last = names.after;
  for (const NameRecord& each : names.records) {
    const NameClaim& claim = each.claim;
    if (claim.version <= last) fields.fail("has names whose versions do not ascend");
    last = claim.version;
    const bool own = claim.state == NameState::deleted || hub_of(claim.node) == names.hub;
    const bool own_group = !claim.service || hub_of(claim.service->group) == names.hub;
    if (!own || !own_group) fields.fail("has a name of another hub");
  }
  if (last > names.version) fields.fail("has a name that is newer than it says");
  return names;
}

void NamesTaken::write(bitestream::Writer& writer) const {
  if (messages != 1) writer.put_u32(1, messages);
}
NamesTaken NamesTaken::read(Fields& fields) {
  return {fields.number<std::uint32_t>(1, "number of messages", 1)};
}

}  // namespace gimnet::proto::route
