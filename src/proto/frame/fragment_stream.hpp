#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "proto/frame/frame_header.hpp"

namespace gimnet::proto {

/// Within one of these, fragments come in order and one message after the other
/// (docs/protocol.md, section 6).
struct FragmentStream {
  std::uint32_t src = 0;
  std::uint32_t dst = 0;
  Kind kind = Kind::unicast;
  std::uint8_t lane = 0;
  [[nodiscard]] static FragmentStream of(const FrameHeader& header) {
    return {header.src, header.dst, header.kind, header.lane};
  }
  friend constexpr bool operator==(const FragmentStream&, const FragmentStream&) = default;
};

/// One entry of a table in which the messages of all sources share the room.
struct Holding {
  std::uint32_t src = 0;
  std::uint64_t amount = 0;
};

/// The entry that goes where the table is full: the first one, of those with an amount, of the
/// source with the largest sum; of several such sources that of the first entry. So a source that
/// fills the table takes no place of others. Cost: O(n log n).
/// REQUIRES: an amount is not 0.
[[nodiscard]] std::size_t first_of_fullest_source(std::span<const Holding> by_age);

}  // namespace gimnet::proto
