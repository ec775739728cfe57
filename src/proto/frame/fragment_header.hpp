#pragma once

#include <cstddef>
#include <cstdint>

#include "base/endian.hpp"

namespace gimnet::proto {

inline constexpr std::size_t kFragmentHeaderSize = 12;

/// Which part of which message a frame carries (docs/protocol.md, section 6). Offset and total
/// count payload bytes.
struct FragmentHeader {
  std::uint32_t message = 0;  ///< number, unique per sender over all kinds and destinations
  std::uint32_t offset = 0;
  std::uint32_t total = 0;
  friend constexpr bool operator==(const FragmentHeader&, const FragmentHeader&) = default;
};

/// REQUIRES: 12 readable bytes.
[[nodiscard]] inline FragmentHeader load_fragment_header(const std::byte* bytes) {
  return {load_le<std::uint32_t>(bytes), load_le<std::uint32_t>(bytes + 4),
          load_le<std::uint32_t>(bytes + 8)};
}

/// REQUIRES: 12 writable bytes.
inline void store_fragment_header(std::byte* bytes, const FragmentHeader& fragment) {
  store_le(bytes, fragment.message);
  store_le(bytes + 4, fragment.offset);
  store_le(bytes + 8, fragment.total);
}

}  // namespace gimnet::proto
