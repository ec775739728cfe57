#include "proto/control/route_groups.hpp"

#include <algorithm>

#include "base/endian.hpp"

namespace gimnet::proto::route {
namespace {

namespace join_key {
enum : std::uint32_t { groups = 1, anew, subscribers };
}  // namespace join_key

// An entry of JOIN on the wire: {u32 group id, u32 interval, u16 depth, u16 window}.
constexpr std::size_t kIntervalOffset = 4;
constexpr std::size_t kDepthOffset = 8;
constexpr std::size_t kWindowOffset = 10;
constexpr std::size_t kEntrySize = 12;

/// The list under key 1, of entries of one size.
std::vector<std::byte> read_list(Fields& fields, std::size_t entry_size) {
  auto bytes = fields.opaque(join_key::groups, "list of groups", kGroupsMax * entry_size);
  if (bytes.empty() || bytes.size() % entry_size != 0)
    fields.fail("has a list of groups that is cut or empty");
  if (fields.failed()) bytes.clear();
  return bytes;
}

GroupId read_group(Fields& fields, const std::byte* bytes) {
  const GroupId group{load_le<std::uint32_t>(bytes)};
  const HubId hub = hub_of(group);
  const std::uint32_t index = index_of(group);
  if (!names_a_hub(hub) || index == 0 || index > kIndexMost)
    fields.fail("has a group id that cannot be one");
  return group;
}

void write_groups(bitestream::Writer& writer, const std::vector<GroupId>& groups) {
  GIMNET_ASSERT(!groups.empty() && groups.size() <= kGroupsMax);
  std::vector<std::byte> list(groups.size() * sizeof(std::uint32_t));
  std::byte* next = list.data();
  for (const GroupId group : groups) {
    store_le(next, group.value());
    next += sizeof(std::uint32_t);
  }
  writer.put_opaque(join_key::groups, list);
}

std::vector<GroupId> read_groups(Fields& fields) {
  std::vector<GroupId> groups;
  const auto bytes = read_list(fields, sizeof(std::uint32_t));
  for (std::size_t at = 0; at < bytes.size(); at += sizeof(std::uint32_t))
    groups.push_back(read_group(fields, bytes.data() + at));
  return groups;
}

}  // namespace

void Join::write(bitestream::Writer& writer) const {
  GIMNET_ASSERT(!groups.empty() && groups.size() <= kGroupsMax);
  std::vector<std::byte> list(groups.size() * kEntrySize);
  std::byte* next = list.data();
  for (const Entry& each : groups) {
    store_le(next, each.group.value());
    store_le(next + kIntervalOffset, each.terms.interval_us);
    store_le(next + kDepthOffset, each.terms.depth);
    store_le(next + kWindowOffset, each.terms.window);
    next += kEntrySize;
  }
  writer.put_opaque(join_key::groups, list);
  if (anew) writer.put_bool(join_key::anew, true);
  // A hub that is told nothing takes 1 for each.
  if (std::ranges::all_of(groups, [](const Entry& each) { return each.subscribers == 1; })) return;
  list.resize(groups.size() * sizeof(std::uint32_t));
  next = list.data();
  for (const Entry& each : groups) {
    store_le(next, each.subscribers);
    next += sizeof(std::uint32_t);
  }
  writer.put_opaque(join_key::subscribers, list);
}

Join Join::read(Fields& fields) {
  Join join;
  const auto bytes = read_list(fields, kEntrySize);
  for (std::size_t at = 0; at < bytes.size(); at += kEntrySize) {
    const std::byte* entry = bytes.data() + at;
    join.groups.push_back({read_group(fields, entry),
                           {load_le<std::uint32_t>(entry + kIntervalOffset),
                            load_le<std::uint16_t>(entry + kDepthOffset),
                            load_le<std::uint16_t>(entry + kWindowOffset)}});
    if (join.groups.back().terms.depth == 0) fields.fail("has a depth of 0");
  }
  join.anew = fields.flag(join_key::anew, "wish for last messages", false);
  if (!fields.has(join_key::subscribers)) return join;
  const auto numbers = fields.opaque(join_key::subscribers, "list of subscribers",
                                     kGroupsMax * sizeof(std::uint32_t));
  if (fields.failed()) return join;
  if (numbers.size() != join.groups.size() * sizeof(std::uint32_t)) {
    fields.fail("has not one number of subscribers for each group");
    return join;
  }
  const std::byte* number = numbers.data();
  for (Entry& each : join.groups) {
    each.subscribers = load_le<std::uint32_t>(number);
    number += sizeof(std::uint32_t);
    if (each.subscribers == 0) fields.fail("joins a group for nobody");
  }
  return join;
}

void Leave::write(bitestream::Writer& writer) const { write_groups(writer, groups); }
Leave Leave::read(Fields& fields) { return {read_groups(fields)}; }

void Joined::write(bitestream::Writer& writer) const { write_groups(writer, groups); }
Joined Joined::read(Fields& fields) { return {read_groups(fields)}; }

}  // namespace gimnet::proto::route
