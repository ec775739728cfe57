#include "hub/data/egress/source_bytes.hpp"

#include <algorithm>

namespace gimnet::hub {

std::uint8_t SourceBytes::loser() const {
  const auto most = std::max_element(bytes_.begin(), bytes_.begin() + kSources);
  return static_cast<std::uint8_t>(most - bytes_.begin());
}

std::uint8_t SourceBytes::fullest() const {
  std::uint8_t most = 0;
  std::uint64_t most_bytes = 0;
  for (std::uint8_t each = 0; each < kSources; ++each) {
    const std::uint64_t bytes = std::uint64_t{bytes_[each]} + bytes_[each + kFixed];
    if (bytes <= most_bytes) continue;
    most = each;
    most_bytes = bytes;
  }
  return most;
}

}  // namespace gimnet::hub
