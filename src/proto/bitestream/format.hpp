#pragma once

#include <cstddef>
#include <cstdint>

#include "gimnet/bitestream.h"

// The layout of docs/bitestream.md as constants, for the writer and the reader.
// Thread safety: pure functions.

namespace gimnet::proto::bitestream {

/// As in gimnet/bitestream.h, where each value is explained.
using Type = bitestream_type;
using Status = bitestream_status;

inline constexpr unsigned kLengthSizeMask = 0x03;
inline constexpr unsigned kLengthSizeInvalid = 3;
inline constexpr unsigned kTextKeyBit = 0x04;
inline constexpr unsigned kTypeShift = 3;
inline constexpr unsigned kArrayBit = 16;
inline constexpr std::size_t kNumberKeySize = 3;

[[nodiscard]] constexpr bool is_array(Type type) {
  return (static_cast<unsigned>(type) & kArrayBit) != 0;
}
[[nodiscard]] constexpr Type element_type(Type array) {
  return static_cast<Type>(static_cast<unsigned>(array) & ~kArrayBit);
}
/// Numbers convert between each other; bool and time are no numbers.
[[nodiscard]] constexpr bool is_number(Type type) {
  return type >= BITESTREAM_U8 && type <= BITESTREAM_F64;
}

/// Bytes of a value of that type or, for an array, of one element; 0: any number of bytes.
[[nodiscard]] constexpr std::size_t unit_size(Type type) {
  constexpr std::uint8_t kSizes[16] = {0, 1, 1, 2, 4, 8, 1, 2, 4, 8, 4, 8, 0, 8, 0, 0};
  return kSizes[static_cast<unsigned>(element_type(type))];
}

[[nodiscard]] constexpr bool is_known_type(unsigned type) {
  constexpr std::uint32_t kInvalid = (1u << 15) | (1u << 16) | (1u << 28) | (1u << 30) | (1u << 31);
  return type < 32 && ((kInvalid >> type) & 1u) == 0;
}

/// A value of that many bytes is legal.
[[nodiscard]] constexpr bool size_fits(Type type, std::size_t size) {
  if (size == 0 || size > BITESTREAM_VALUE_BYTES_MAX) return false;
  const std::size_t unit = unit_size(type);
  if (unit == 0) return true;
  return is_array(type) ? size % unit == 0 : size == unit;
}

}  // namespace gimnet::proto::bitestream
