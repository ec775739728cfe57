#include "proto/frame/fragment_stream.hpp"

#include <algorithm>
#include <vector>

#include "base/check.hpp"

namespace gimnet::proto {

std::size_t first_of_fullest_source(std::span<const Holding> by_age) {
  std::vector<Holding> by_source(by_age.begin(), by_age.end());
  std::ranges::sort(by_source, {}, &Holding::src);
  std::vector<Holding> sums;
  for (const Holding& each : by_source) {
    if (sums.empty() || sums.back().src != each.src) {
      sums.push_back(each);
    } else {
      sums.back().amount += each.amount;
    }
  }
  const std::uint64_t largest = std::ranges::max(sums, {}, &Holding::amount).amount;
  const auto goes = std::ranges::find_if(by_age, [&](const Holding& each) {
    return each.amount != 0 &&
           std::ranges::lower_bound(sums, each.src, {}, &Holding::src)->amount == largest;
  });
  GIMNET_CHECK(goes != by_age.end());
  return static_cast<std::size_t>(goes - by_age.begin());
}

}  // namespace gimnet::proto
