#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <variant>

#include "base/ids.hpp"
#include "proto/frame/frame_header.hpp"

// Payloads of FLOW frames (docs/protocol.md, section 4): fixed layouts, handled without the control
// thread. Thread safety: value types and pure functions.

namespace gimnet::proto::flow {

enum class FlowOperation : std::uint8_t {
  ping = 1,
  pong = 2,
  credit = 3,
  pause = 4,
  resume = 5,
  confirm = 6,
  skip = 7,
  dropped = 8,
  missed = 9
};

/// Are you there? Times in ns since 1970.
struct Ping {
  std::uint32_t sequence = 0;
  std::int64_t sent_ns = 0;
  friend constexpr bool operator==(const Ping&, const Ping&) = default;
};

/// Yes; sequence and sent time as in the PING.
struct Pong {
  std::uint32_t sequence = 0;
  std::int64_t sent_ns = 0;
  std::int64_t now_ns = 0;
  friend constexpr bool operator==(const Pong&, const Pong&) = default;
};

/// So many messages of the group were taken, in total.
struct Credit {
  GroupId group;
  std::uint64_t taken = 0;
  std::uint8_t number = 0;  ///< of the counts, as the SUBSCRIBE said that began them
  friend constexpr bool operator==(const Credit&, const Credit&) = default;
};

/// The subject of PAUSE and RESUME.
struct Target {
  Kind kind = Kind::unicast;
  Lane lane = Lane::normal;
  std::uint32_t dst = 0;
  friend constexpr bool operator==(const Target&, const Target&) = default;
};

/// Hold what is for that target.
struct Pause {
  Target target;
  friend constexpr bool operator==(const Pause&, const Pause&) = default;
};

/// There is room again.
struct Resume {
  Target target;
  friend constexpr bool operator==(const Resume&, const Resume&) = default;
};

/// So many data frames of this epoch were taken.
struct Confirm {
  std::uint64_t count = 0;
  friend constexpr bool operator==(const Confirm&, const Confirm&) = default;
};

inline constexpr std::uint64_t kSkipUnknown = UINT64_MAX;

/// Stands for `count` data frames that are not sent again.
struct Skip {
  DropReason reason = DropReason::none;  ///< none: a reason that this version does not know
  std::uint64_t count = 0;               ///< or kSkipUnknown
  friend constexpr bool operator==(const Skip&, const Skip&) = default;
};

/// So many data frames for this node were dropped before they were sent, since the hub said so
/// last.
struct Dropped {
  DropReason reason = DropReason::none;  ///< of the latest; none: as in Skip
  NodeId source;                         ///< most bytes that waited were its; 0: not known
  std::uint64_t count = 0;
  friend constexpr bool operator==(const Dropped&, const Dropped&) = default;
};

/// So many messages of the group were missed by the subscriptions of this node, in total: to a hub
/// that offers proto::kFeatureMissed.
struct Missed {
  GroupId group;
  std::uint64_t total = 0;
  friend constexpr bool operator==(const Missed&, const Missed&) = default;
};

using Message = std::variant<Ping, Pong, Credit, Pause, Resume, Confirm, Skip, Dropped, Missed>;

inline constexpr std::size_t kSizeMax = 24;

/// Nothing: the payload is malformed (unknown operation, too short, a lane over 3). Bytes after the
/// layout are skipped.
[[nodiscard]] std::optional<Message> decode(std::span<const std::byte> payload);

/// Writes the payload and returns its size, at most kSizeMax.
std::size_t encode(const Message& message, std::span<std::byte, kSizeMax> payload);

/// Writes a whole FLOW frame (dst 0, lane 0) and returns its size, at most kFrameSizeMax.
inline constexpr std::size_t kFrameSizeMax = kHeaderSize + kSizeMax;
std::size_t encode_frame(const Message& message, NodeId src,
                         std::span<std::byte, kFrameSizeMax> frame);

}  // namespace gimnet::proto::flow
