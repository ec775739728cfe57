#include "hub/data/egress/source_bytes.hpp"

#include <algorithm>
#include <span>

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

std::uint32_t SourceBytes::fixed_sources() const {
  const auto fixed = std::span(bytes_).subspan(kFixed);
  return std::max<std::uint32_t>(1, static_cast<std::uint32_t>(std::ranges::count_if(
                                        fixed, [](std::uint32_t bytes) { return bytes != 0; })));
}

std::uint32_t SourceBytes::below(std::uint64_t bytes) const {
  std::uint32_t places = 0;
  for (std::uint8_t each = 0; each < kSources; ++each)
    if (fixed(each) <= bytes) places |= 1u << each;
  return places;
}

}  // namespace gimnet::hub
