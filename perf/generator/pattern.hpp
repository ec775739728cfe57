#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

// What is in a payload: 8 bytes of stamp (stream << 48 | sequence), then a fixed pseudo-random
// pattern. So a block of messages is built once, only stamps are renewed, and a receiver checks
// every byte with one comparison.

namespace gimnet::perf {

inline constexpr std::size_t kStampBytes = 8;
inline constexpr std::size_t kPayloadBytesMin = 16;
inline constexpr std::size_t kPayloadBytesMax = 1024 * 1024;

/// Numbers the messages of one sender to one target.
using StreamId = std::uint16_t;

[[nodiscard]] constexpr std::uint64_t make_stamp(StreamId stream, std::uint64_t sequence) {
  return (static_cast<std::uint64_t>(stream) << 48) | sequence;
}

inline void store_u32(std::byte* to, std::uint32_t value) {
  std::memcpy(to, &value, sizeof(value));
}
inline void store_u64(std::byte* to, std::uint64_t value) {
  std::memcpy(to, &value, sizeof(value));
}
[[nodiscard]] inline std::uint32_t load_u32(const std::byte* from) {
  std::uint32_t value = 0;
  std::memcpy(&value, from, sizeof(value));
  return value;
}
[[nodiscard]] inline std::uint64_t load_u64(const std::byte* from) {
  std::uint64_t value = 0;
  std::memcpy(&value, from, sizeof(value));
  return value;
}

/// A payload of `size` bytes with stamp 0. REQUIRES: kPayloadBytesMin <= size <= kPayloadBytesMax.
[[nodiscard]] std::span<const std::byte> pattern_payload(std::size_t size);

}  // namespace gimnet::perf
