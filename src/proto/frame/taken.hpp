#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "base/endian.hpp"

namespace gimnet::proto {

inline constexpr std::size_t kTakenSize = 12;

/// Progress of a fragmented UNICAST message, from receiver to sender; both numbers are cumulative
/// (docs/protocol.md, section 6). Thread safety: a value type.
struct Taken {
  std::uint32_t message = 0;  ///< number of the message
  std::uint32_t taken = 0;    ///< bytes taken so far
  std::uint32_t allowed = 0;  ///< offset up to which the sender may send

  /// The receiver will not take this message: it is too large.
  [[nodiscard]] constexpr bool refuses() const { return taken == 0 && allowed == 0; }
  friend constexpr bool operator==(const Taken&, const Taken&) = default;
};

/// Nothing: too short. Bytes after the layout are skipped.
[[nodiscard]] inline std::optional<Taken> decode_taken(std::span<const std::byte> payload) {
  if (payload.size() < kTakenSize) return std::nullopt;
  const std::byte* bytes = payload.data();
  return Taken{load_le<std::uint32_t>(bytes), load_le<std::uint32_t>(bytes + 4),
               load_le<std::uint32_t>(bytes + 8)};
}

inline void encode_taken(const Taken& taken, std::span<std::byte, kTakenSize> payload) {
  store_le(payload.data(), taken.message);
  store_le(payload.data() + 4, taken.taken);
  store_le(payload.data() + 8, taken.allowed);
}

}  // namespace gimnet::proto
