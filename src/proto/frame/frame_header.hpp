#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "base/ids.hpp"

// The 16 bytes before every frame; the layout, with an annotated example, is in docs/protocol.md,
// section 2. Thread safety: value types and pure functions.

namespace gimnet::proto {

inline constexpr std::size_t kHeaderSize = 16;
/// Largest `length` that every hub and link carries.
inline constexpr std::uint32_t kFrameLengthDefault = 64 * 1024;
/// Largest `length` that can be announced.
inline constexpr std::uint32_t kFrameLengthMax = 1024 * 1024;
inline constexpr std::uint32_t kListRecipientsMax = 1024;

enum class Kind : std::uint8_t {
  unicast = 0,
  group = 1,
  list = 2,
  broadcast = 3,
  service = 4,
  report = 5,
  flow = 6,
  taken = 7,
  link = 16,
  ns = 17,
  ctrl = 18,
  route = 19,
};
inline constexpr std::uint8_t kFirstControlKind = 16;

enum class Policy : std::uint8_t { kind_default = 0, block = 1, drop = 2, latest = 3 };

enum class Lane : std::uint8_t { real_time = 0, normal = 1, bulk = 2, background = 3 };
inline constexpr std::size_t kLaneCount = 4;
/// A frame crosses at most so many links: a chain of 32 hubs works.
inline constexpr std::uint8_t kHopsMax = 31;

inline constexpr std::uint8_t kFlagPolicyMask = 0x03;
inline constexpr std::uint8_t kFlagReport = 0x04;
inline constexpr std::uint8_t kFlagFragment = 0x08;
inline constexpr std::uint8_t kFlagExt = 0x10;
inline constexpr std::uint8_t kFlagKeyed = 0x20;
inline constexpr std::uint8_t kFlagReservedMask = 0xC0;
inline constexpr std::uint8_t kLaneMask = 0x03;

/// A header as fields. On the wire all integers are little-endian; so is every machine this builds
/// for, which load_header() asserts at compile time.
struct FrameHeader {
  std::uint32_t length = 0;
  std::uint32_t dst = 0;
  std::uint32_t src = 0;
  Kind kind = Kind::unicast;
  std::uint8_t flags = 0;
  std::uint8_t hops = 0;
  std::uint8_t lane = static_cast<std::uint8_t>(Lane::normal);

  [[nodiscard]] constexpr Policy policy() const {
    return static_cast<Policy>(flags & kFlagPolicyMask);
  }
  [[nodiscard]] constexpr bool has(std::uint8_t flag) const { return (flags & flag) != 0; }
  /// Header and what follows it.
  [[nodiscard]] constexpr std::size_t frame_size() const { return kHeaderSize + length; }
  friend constexpr bool operator==(const FrameHeader&, const FrameHeader&) = default;
};
static_assert(sizeof(FrameHeader) == kHeaderSize);

// The offsets of fields in a header, for code that looks at a few of its bytes only.
inline constexpr std::size_t kDstOffset = offsetof(FrameHeader, dst);
inline constexpr std::size_t kSrcOffset = offsetof(FrameHeader, src);
inline constexpr std::size_t kKindOffset = offsetof(FrameHeader, kind);
inline constexpr std::size_t kHopsOffset = offsetof(FrameHeader, hops);
inline constexpr std::size_t kLaneOffset = offsetof(FrameHeader, lane);
/// 8 bytes: dst and src.
inline constexpr std::size_t kAddressesOffset = kDstOffset;
/// 4 bytes: kind, flags, hops, lane.
inline constexpr std::size_t kAttributesOffset = kKindOffset;

/// Bytes of the key of a frame with KEYED.
inline constexpr std::size_t kKeySize = 8;

/// Never dropped for room: BLOCK, or a kind whose default it is.
[[nodiscard]] constexpr bool is_block(const FrameHeader& header) {
  if (header.policy() != Policy::kind_default) return header.policy() == Policy::block;
  return header.kind != Kind::group && header.kind != Kind::list && header.kind != Kind::broadcast;
}

/// REQUIRES: 16 readable bytes at `bytes`.
[[nodiscard]] inline FrameHeader load_header(const std::byte* bytes) {
  static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__);
  FrameHeader header;
  std::memcpy(&header, bytes, kHeaderSize);
  return header;
}

/// REQUIRES: 16 writable bytes at `bytes`.
inline void store_header(std::byte* bytes, const FrameHeader& header) {
  std::memcpy(bytes, &header, kHeaderSize);
}

/// The reasons why a frame was not delivered: the closed list of docs/protocol.md, section 5.
/// `not_retained` is of REPORTs only: such a frame is delivered all the same.
enum class DropReason : std::uint8_t {
  none = 0,
  no_such_node = 1,
  no_route = 2,
  away = 3,
  queue_full = 4,
  replaced = 5,
  too_old = 6,
  hop_limit = 7,
  too_large = 8,
  not_allowed = 9,
  wrong_way = 10,
  link_lost = 11,
  shard_full = 12,
  no_such_group = 13,
  renumbered = 14,
  over_budget = 15,
  timed_out = 16,
  cut_message = 17,
  no_subscriber = 18,
  malformed = 19,
  wrong_source = 20,
  not_retained = 21,
  link_unsure = 22,  ///< it may have arrived
};
inline constexpr std::size_t kDropReasonCount = 23;

/// The reason's name as documents and tools print it, for example "queue_full".
[[nodiscard]] constexpr const char* drop_reason_name(DropReason reason) {
  constexpr const char* kNames[kDropReasonCount] = {
      "none",          "no_such_node",  "no_route",     "away",         "queue_full", "replaced",
      "too_old",       "hop_limit",     "too_large",    "not_allowed",  "wrong_way",  "link_lost",
      "shard_full",    "no_such_group", "renumbered",   "over_budget",  "timed_out",  "cut_message",
      "no_subscriber", "malformed",     "wrong_source", "not_retained", "link_unsure"};
  const auto index = static_cast<std::size_t>(reason);
  return index < kDropReasonCount ? kNames[index] : "unknown";
}

}  // namespace gimnet::proto
