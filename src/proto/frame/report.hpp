#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "proto/frame/frame_header.hpp"

// The payload of REPORT frames: what became of frames that could not be delivered
// (docs/protocol.md, section 5). Thread safety: value types and pure functions.

namespace gimnet::proto {

/// A key and a GIMI header.
inline constexpr std::size_t kReportFollowingMax = 20;
inline constexpr std::size_t kReportSizeMin = 8 + kHeaderSize;
inline constexpr std::size_t kReportSizeMax = kReportSizeMin + kReportFollowingMax;

struct Report {
  DropReason reason = DropReason::none;  ///< none: a reason that this version does not know
  std::uint32_t count = 0;               ///< frames, 0 only from a broken hub
  FrameHeader header;                    ///< of the last of them
  /// The first bytes after that header, at most 20. Valid until: the decoded payload changes.
  std::span<const std::byte> following;
};

/// Nothing: too short. Bytes after the layout are skipped.
[[nodiscard]] std::optional<Report> decode_report(std::span<const std::byte> payload);

/// Writes the payload and returns its size. Of `following` the first 20 bytes count.
std::size_t encode_report(const Report& report, std::span<std::byte, kReportSizeMax> payload);

}  // namespace gimnet::proto
