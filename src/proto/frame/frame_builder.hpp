#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "base/ids.hpp"
#include "proto/frame/fragment_header.hpp"
#include "proto/frame/frame_header.hpp"

// Writes frames. The prefix is everything before the payload, so that a sender can gather prefix
// and payload in one write without copying the payload. Thread safety: pure functions on the
// caller's bytes.

namespace gimnet::proto {

/// A frame by its parts. `header.length`, the flags FRAGMENT, EXT and KEYED, and dst of a LIST with
/// recipients are set by the builder from what is there.
struct FrameParts {
  FrameHeader header;
  std::span<const NodeId> recipients;     ///< LIST from a node: 1..1024, strictly ascending
  std::span<const std::byte> extensions;  ///< at most 65,535 bytes, see ExtensionWriter
  std::optional<FragmentHeader> fragment;
  std::optional<std::uint64_t> key;
  std::size_t payload_size = 0;
};

/// Room that any prefix without recipients and extensions needs.
inline constexpr std::size_t kPrefixSizeMax = kHeaderSize + kFragmentHeaderSize + 8;

/// Bytes before the payload.
[[nodiscard]] std::size_t prefix_size(const FrameParts& parts);

/// Writes everything before the payload and returns its size; 0: `memory` is too small, nothing is
/// written. REQUIRES: the whole frame's length fits in 32 bits.
[[nodiscard]] std::size_t write_prefix(const FrameParts& parts, std::span<std::byte> memory);

/// Writes the whole frame and returns its size; 0: `memory` is too small, nothing is written.
/// `parts.payload_size` is ignored: the payload's size counts.
[[nodiscard]] std::size_t write_frame(const FrameParts& parts, std::span<const std::byte> payload,
                                      std::span<std::byte> memory);

}  // namespace gimnet::proto
