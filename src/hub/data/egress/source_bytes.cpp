#include "hub/data/egress/source_bytes.hpp"

#include <algorithm>

namespace gimnet::hub {

bool SourceBytes::is_alone(std::uint8_t place) const {
  std::uint32_t others = 0;
  for (std::uint8_t each = 0; each < kSources; ++each) {
    if (each != place) others |= bytes_[each];
  }
  return others == 0;
}

bool SourceBytes::at_most_one() const {
  return std::count_if(bytes_.begin(), bytes_.begin() + kSources,
                       [](std::uint32_t bytes) { return bytes != 0; }) <= 1;
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

void SourceBytes::choose(std::uint64_t lane_bytes) {
  const auto most = std::max_element(bytes_.begin(), bytes_.begin() + kSources);
  loser_ = static_cast<std::uint8_t>(most - bytes_.begin());
  const std::uint64_t step = std::max<std::uint64_t>(1, lane_bytes / kStepsPerLane);
  floor_ = *most > step ? static_cast<std::uint32_t>(*most - step) : 0;
  chosen_ = !at_most_one();
}

}  // namespace gimnet::hub
