#pragma once

#include <cstddef>
#include <cstring>
#include <type_traits>

namespace gimnet {

/// Reads a number as it stands on the wire: little-endian, at any alignment. REQUIRES: sizeof(T)
/// readable bytes.
template <class T>
[[nodiscard]] inline T load_le(const std::byte* bytes) {
  static_assert(std::is_trivially_copyable_v<T>);
  static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__,
                "big-endian machines need a byte swap here");
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return value;
}

/// Writes a number as it stands on the wire. REQUIRES: sizeof(T) writable bytes.
template <class T>
inline void store_le(std::byte* bytes, T value) {
  static_assert(std::is_trivially_copyable_v<T>);
  static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__,
                "big-endian machines need a byte swap here");
  std::memcpy(bytes, &value, sizeof value);
}

}  // namespace gimnet
