#include "generator/messages.hpp"

#include <vector>

namespace gimnet::perf {

std::span<const std::byte> pattern_payload(std::size_t size) {
  static const std::vector<std::byte> pattern = [] {
    std::vector<std::byte> bytes(kPayloadBytesMax);
    std::uint64_t state = 0x9E3779B97F4A7C15ull;
    for (std::size_t at = kStampBytes; at < bytes.size(); at += 8) {
      state ^= state << 13;  // Marsaglia's xorshift64
      state ^= state >> 7;
      state ^= state << 17;
      store_u64(bytes.data() + at, state);
    }
    return bytes;
  }();
  return {pattern.data(), size};
}

}  // namespace gimnet::perf
