#include "proto/control/route.hpp"

#include <algorithm>
#include <optional>

#include "base/endian.hpp"
#include "proto/control/names.hpp"

namespace gimnet::proto::route {
namespace {

namespace record_key {
enum : std::uint32_t {
  hub = 1,
  unique,
  instance,
  configured,
  part,
  sequence,
  behind,
  name,
  version,
  features,
  features_required,
  neighbours,
  proof,  // reserved
};
}  // namespace record_key

namespace keep_alive_key {
enum : std::uint32_t { sent = 1, heard_sent, heard, taken, digest, cost };
}  // namespace keep_alive_key

constexpr std::size_t kUniqueIdSize = sizeof(UniqueId::bytes);
// A neighbour on the wire: {u16 hub id, u16 cost, u8[16] unique id}.
constexpr std::size_t kCostOffset = 2;
constexpr std::size_t kUniqueIdOffset = 4;
constexpr std::size_t kNeighbourSize = kUniqueIdOffset + kUniqueIdSize;

std::span<const std::byte> bytes_of(const UniqueId& unique) {
  return std::as_bytes(std::span(unique.bytes));
}

/// REQUIRES: 16 readable bytes.
UniqueId load_unique_id(const std::byte* bytes) {
  UniqueId unique;
  std::transform(bytes, bytes + kUniqueIdSize, unique.bytes.begin(),
                 [](std::byte each) { return std::to_integer<std::uint8_t>(each); });
  return unique;
}

HubKey read_hub_key(Fields& fields) {
  HubKey key;
  key.hub = HubId{fields.required_number<std::uint16_t>(record_key::hub, "hub id")};
  if (!names_a_hub(key.hub)) fields.fail("has a hub id that is not in 1..4094");
  const auto unique = fields.opaque(record_key::unique, "unique id", kUniqueIdSize);
  if (unique.size() == kUniqueIdSize) {
    key.unique = load_unique_id(unique.data());
  } else {
    fields.fail("has no unique id of 16 bytes (key 2)");
  }
  return key;
}

/// Nothing: it cannot stand behind `last`.
std::optional<Neighbour> load_neighbour(const std::byte* bytes, const Neighbour* last) {
  const Neighbour neighbour{
      {HubId{load_le<std::uint16_t>(bytes)}, load_unique_id(bytes + kUniqueIdOffset)},
      load_le<std::uint16_t>(bytes + kCostOffset)};
  if (!names_a_hub(neighbour.hub.hub) || neighbour.cost == 0) return std::nullopt;
  if (last != nullptr && neighbour.hub <= last->hub) return std::nullopt;
  return neighbour;
}

std::vector<Neighbour> read_neighbours(Fields& fields) {
  const auto bytes =
      fields.opaque(record_key::neighbours, "list of neighbours", kNeighboursMax * kNeighbourSize);
  std::vector<Neighbour> neighbours;
  if (bytes.size() % kNeighbourSize != 0) fields.fail("has a list of neighbours that is cut");
  for (std::size_t at = 0; at < bytes.size() && !fields.failed(); at += kNeighbourSize) {
    const auto next =
        load_neighbour(bytes.data() + at, neighbours.empty() ? nullptr : &neighbours.back());
    if (next) {
      neighbours.push_back(*next);
    } else {
      fields.fail("has neighbours that are no hubs, cost nothing, or do not ascend");
    }
  }
  return neighbours;
}

}  // namespace

void RecordPart::write(bitestream::Writer& writer) const {
  namespace key = record_key;
  GIMNET_ASSERT(neighbours.size() <= kNeighboursMax);
  writer.put_u16(key::hub, hub.hub.value());
  writer.put_opaque(key::unique, bytes_of(hub.unique));
  writer.put_u64(key::instance, instance.value());
  if (configured) writer.put_bool(key::configured, true);
  if (part != 0) writer.put_u16(key::part, part);
  writer.put_u64(key::sequence, sequence);
  if (part == 0) {
    if (behind != HubInstance{}) writer.put_u64(key::behind, behind.value());
    put_clean_text(writer, key::name, name, kNameBytesMax);
    put_clean_text(writer, key::version, version, kRemarkBytesMax);
    if (features != 0) writer.put_u64(key::features, features);
    if (features_required != 0) writer.put_u64(key::features_required, features_required);
  }
  std::vector<std::byte> list(neighbours.size() * kNeighbourSize);
  std::byte* next = list.data();
  for (const Neighbour& neighbour : neighbours) {
    store_le(next, neighbour.hub.hub.value());
    store_le(next + kCostOffset, neighbour.cost);
    std::ranges::copy(bytes_of(neighbour.hub.unique), next + kUniqueIdOffset);
    next += kNeighbourSize;
  }
  writer.put_opaque(key::neighbours, list);
}

RecordPart RecordPart::read(Fields& fields) {
  namespace key = record_key;
  RecordPart record;
  record.hub = read_hub_key(fields);
  record.instance = HubInstance{fields.required_number<std::uint64_t>(key::instance, "instance")};
  record.configured = fields.flag(key::configured, "rank", false);
  record.part = fields.number<std::uint16_t>(key::part, "part", 0);
  if (record.part >= kPartsMax) fields.fail("has a part that is not in 0..63");
  record.sequence = fields.required_number<std::uint64_t>(key::sequence, "sequence");
  if (record.part == 0) {
    record.behind =
        HubInstance{fields.number<std::uint64_t>(key::behind, "instance gone on behind", 0)};
    record.name = fields.text(key::name, "hub name", kNameBytesMax);
    record.version = fields.text(key::version, "version", kRemarkBytesMax);
    record.features = fields.number<std::uint64_t>(key::features, "feature set", 0);
    record.features_required =
        fields.number<std::uint64_t>(key::features_required, "set of required features", 0);
  }
  record.neighbours = read_neighbours(fields);
  return record;
}

void KeepAlive::write(bitestream::Writer& writer) const {
  namespace key = keep_alive_key;
  writer.put_time(key::sent, sent_ns);
  if (heard_sent_ns != 0) writer.put_time(key::heard_sent, heard_sent_ns);
  if (heard_ns != 0) writer.put_time(key::heard, heard_ns);
  writer.put_u64(key::taken, taken);
  writer.put_u64(key::digest, digest);
  if (cost != 0) writer.put_u16(key::cost, cost);
}

KeepAlive KeepAlive::read(Fields& fields) {
  namespace key = keep_alive_key;
  KeepAlive alive;
  alive.sent_ns = fields.time(key::sent, "time of sending");
  alive.heard_sent_ns = fields.time(key::heard_sent, "time of sending of the last one heard");
  alive.heard_ns = fields.time(key::heard, "time of hearing");
  alive.taken = fields.required_number<std::uint64_t>(key::taken, "count of frames taken");
  alive.digest = fields.required_number<std::uint64_t>(key::digest, "digest");
  alive.cost = fields.number<std::uint16_t>(key::cost, "cost", 0);
  return alive;
}

}  // namespace gimnet::proto::route
