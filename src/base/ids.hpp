#pragma once

#include <charconv>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

namespace gimnet {

/// A number that names one kind of thing only: two ids with different tags neither compare nor
/// convert. Thread safety: a value type.
template <class Tag, class Value>
class StrongId {
 public:
  constexpr StrongId() = default;
  constexpr explicit StrongId(Value value) : value_(value) {}
  [[nodiscard]] constexpr Value value() const { return value_; }
  friend constexpr auto operator<=>(StrongId, StrongId) = default;

 private:
  Value value_{};
};

/// A hub: 12 bits, 1..4094; 0 is "the hub I am connected to", 4095 "every hub" (docs/protocol.md,
/// section 1).
using HubId = StrongId<struct HubIdTag, std::uint16_t>;
/// A node: hub << 20 | index.
using NodeId = StrongId<struct NodeIdTag, std::uint32_t>;
/// A group (one per service): owner hub << 20 | index, in a number space of its own.
using GroupId = StrongId<struct GroupIdTag, std::uint32_t>;
/// A node among those of one hub: the index in its NodeId, 1..kIndexMost. 0: the hub itself, or
/// none.
using NodeIndex = StrongId<struct NodeIndexTag, std::uint32_t>;
/// A group among those of one hub: the index in its GroupId, 1..kIndexMost.
using GroupIndex = StrongId<struct GroupIndexTag, std::uint32_t>;
/// One of the hub's io threads, 0..shards-1.
using ShardIndex = StrongId<struct ShardIndexTag, std::uint8_t>;
/// The place of a session in its shard's table.
using ConnectionSlot = StrongId<struct ConnectionSlotTag, std::uint32_t>;

inline constexpr std::uint32_t kIndexBits = 20;
inline constexpr std::uint32_t kIndexMask = (1u << kIndexBits) - 1;
inline constexpr std::uint32_t kHubIndex = 0;             ///< the hub itself
inline constexpr std::uint32_t kEveryIndex = kIndexMask;  ///< every node of a hub
inline constexpr std::uint32_t kIndexMost = kEveryIndex - 1;
inline constexpr GroupIndex kNoGroup{0};  ///< what a service that nobody provides has
inline constexpr HubId kOwnHub{0};
inline constexpr HubId kEveryHub{4095};
inline constexpr std::uint16_t kHubIdMax = 4094;

/// REQUIRES: hub <= 4095, index < 2^20.
template <class Id>
[[nodiscard]] constexpr Id make_id(HubId hub, std::uint32_t index) {
  return Id{(static_cast<std::uint32_t>(hub.value()) << kIndexBits) | (index & kIndexMask)};
}
template <class Id>
[[nodiscard]] constexpr HubId hub_of(Id id) {
  return HubId{static_cast<std::uint16_t>(id.value() >> kIndexBits)};
}
template <class Id>
[[nodiscard]] constexpr std::uint32_t index_of(Id id) {
  return id.value() & kIndexMask;
}

/// The node of that hub. REQUIRES: hub <= 4095, index < 2^20.
[[nodiscard]] constexpr NodeId make_id(HubId hub, NodeIndex index) {
  return make_id<NodeId>(hub, index.value());
}
/// The group of that hub. REQUIRES: as above.
[[nodiscard]] constexpr GroupId make_id(HubId hub, GroupIndex index) {
  return make_id<GroupId>(hub, index.value());
}
[[nodiscard]] constexpr NodeIndex node_index_of(NodeId node) { return NodeIndex{index_of(node)}; }
[[nodiscard]] constexpr GroupIndex group_index_of(GroupId group) {
  return GroupIndex{index_of(group)};
}

// Ids as people read them, node `7.17`, group `7#17`, and as they type those of nodes.
// Thread safety: pure functions.

namespace detail {

template <class Id>
[[nodiscard]] std::string id_text(Id id, char separator) {
  return std::to_string(hub_of(id).value()) + separator + std::to_string(index_of(id));
}

/// Decimal digits only, at most `max`.
[[nodiscard]] inline std::optional<std::uint32_t> parse_number(std::string_view text,
                                                               std::uint32_t max) {
  std::uint32_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size() || number > max) return std::nullopt;
  return number;
}

}  // namespace detail

[[nodiscard]] inline std::string to_string(NodeId id) { return detail::id_text(id, '.'); }
[[nodiscard]] inline std::string to_string(GroupId id) { return detail::id_text(id, '#'); }

/// Nothing: not `HUB.INDEX` in decimal, or a part is out of range.
[[nodiscard]] inline std::optional<NodeId> parse_node_id(std::string_view text) {
  const auto middle = text.find('.');
  if (middle == std::string_view::npos) return std::nullopt;
  const auto hub = detail::parse_number(text.substr(0, middle), kEveryHub.value());
  const auto index = detail::parse_number(text.substr(middle + 1), kIndexMask);
  if (!hub || !index) return std::nullopt;
  return make_id<NodeId>(HubId{static_cast<std::uint16_t>(*hub)}, *index);
}

}  // namespace gimnet

template <class Tag, class Value>
struct std::hash<gimnet::StrongId<Tag, Value>> {
  std::size_t operator()(gimnet::StrongId<Tag, Value> id) const noexcept {
    return std::hash<Value>{}(id.value());
  }
};
