#include "tools/gimnet/round_trips.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace gimnet::tool {

RoundTrips::Summary RoundTrips::summary_us() const {
  if (ns_.empty()) return {};
  std::vector<std::int64_t> sorted = ns_;
  std::ranges::sort(sorted);
  const auto count = static_cast<double>(sorted.size());
  const auto us = [](std::int64_t ns) { return static_cast<double>(ns) / 1000.0; };
  const auto percentile = [&](double part) {
    const auto rank = static_cast<std::size_t>(std::ceil(part * count));
    return us(sorted[std::clamp<std::size_t>(rank, 1, sorted.size()) - 1]);
  };
  const std::int64_t sum = std::accumulate(sorted.begin(), sorted.end(), std::int64_t{0});
  return {us(sorted.front()), us(sum) / count,   percentile(0.5),
          percentile(0.99),   percentile(0.999), us(sorted.back())};
}

}  // namespace gimnet::tool
