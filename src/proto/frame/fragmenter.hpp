#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "base/check.hpp"

// Cuts the messages of a sender into fragments (docs/protocol.md, section 6).
// Thread safety: value types.

namespace gimnet::proto {

/// Payload bytes of one fragment, unless the peer's largest frame asks for less.
inline constexpr std::uint32_t kFragmentPayload = 32 * 1024;
/// A larger message travels as fragments.
inline constexpr std::uint32_t kUncutMessageMax = 8 * 1024;
/// A larger message has a fragment header, even if it travels as one frame, so that a hub may cut
/// it finer.
inline constexpr std::uint32_t kPlainMessageMax = 4 * 1024;
/// Largest message of the protocol: 1 GiB of an application's data, and room for the headers that a
/// library puts before.
inline constexpr std::uint32_t kMessageBytesMax = (std::uint32_t{1} << 30) + 64 * 1024;

/// True for messages over 4 KiB.
[[nodiscard]] constexpr bool needs_fragment_header(std::size_t message_bytes) {
  return message_bytes > kPlainMessageMax;
}

/// A part of a message.
struct Piece {
  std::uint32_t offset = 0;
  std::uint32_t size = 0;
  friend constexpr bool operator==(const Piece&, const Piece&) = default;
};

/// Yields the pieces of one message in order: one piece up to 8 KiB, then pieces of `piece_size`.
class Fragmenter {
 public:
  /// REQUIRES: total <= kMessageBytesMax, piece_size >= 1. A smaller `piece_size` than 8 KiB cuts
  /// small messages too.
  explicit Fragmenter(std::uint32_t total, std::uint32_t piece_size = kFragmentPayload)
      : total_(total), piece_size_(piece_size) {
    GIMNET_CHECK(total <= kMessageBytesMax && piece_size >= 1);
  }

  [[nodiscard]] bool done() const { return offset_ == total_; }
  [[nodiscard]] std::uint32_t offset() const { return offset_; }
  [[nodiscard]] std::uint32_t total() const { return total_; }

  /// The next piece, of at most `size_max` bytes (a window may have less room than a piece).
  /// REQUIRES: !done(), size_max >= 1.
  [[nodiscard]] Piece next(std::uint32_t size_max = UINT32_MAX) {
    GIMNET_ASSERT(!done() && size_max >= 1);
    const Piece piece{offset_, std::min({total_ - offset_, piece_size_, size_max})};
    offset_ += piece.size;
    return piece;
  }

 private:
  std::uint32_t total_;
  std::uint32_t piece_size_;
  std::uint32_t offset_ = 0;
};

}  // namespace gimnet::proto
