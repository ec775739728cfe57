#include "tools/demo/occupancy_map.hpp"

#include <algorithm>
#include <cmath>

namespace gimnet::demo {
namespace {

constexpr int kHitWeight = 24;
constexpr int kPassWeight = 6;
constexpr int kWeightMax = 96;
constexpr int kOccupiedFrom = 12;

}  // namespace

std::size_t OccupancyMap::IndexHash::operator()(const Index& index) const {
  const auto mixed = static_cast<std::uint64_t>(index.column) * 0x9E3779B97F4A7C15ULL +
                     static_cast<std::uint64_t>(index.row) * 0xC2B2AE3D27D4EB4FULL;
  return static_cast<std::size_t>(mixed ^ (mixed >> 29U));
}

// Poses and ranges are limited where they are read, so no index overflows.
OccupancyMap::Index OccupancyMap::index_of(const Point& point) {
  const auto index = [](double coordinate_m) {
    return static_cast<std::int32_t>(std::floor(std::clamp(coordinate_m / kCell_m, -2e9, 2e9)));
  };
  return {index(point.x_m), index(point.y_m)};
}

void OccupancyMap::add_weight(const Index& index, int change) {
  if (weights_.size() >= kCellsMax && !weights_.contains(index)) return;
  std::int8_t& weight = weights_[index];
  weight = static_cast<std::int8_t>(std::clamp(weight + change, -kWeightMax, kWeightMax));
}

// Steps of half a square: no square of any length on the way is left out, and none before the end
// is taken twice often enough to matter.
void OccupancyMap::clear_along(const Point& from, const Point& to) {
  const auto steps = static_cast<long>(distance_m(from, to) / (kCell_m / 2.0));
  const Index last = index_of(to);
  Index before = last;
  for (long step = 0; step < steps; ++step) {
    const double part = static_cast<double>(step) / static_cast<double>(steps);
    const Index at =
        index_of({from.x_m + part * (to.x_m - from.x_m), from.y_m + part * (to.y_m - from.y_m)});
    if (at == last || at == before) continue;
    before = at;
    add_weight(at, -kPassWeight);
  }
}

void OccupancyMap::add(const Scan& scan) {
  const Point from = position(scan.pose);
  for (std::size_t beam = 0; beam < scan.ranges_m.size(); ++beam) {
    if (!scan.hit(beam)) {
      clear_along(from, point_along(scan.ray(beam), std::min(kFreeWithoutHit_m, scan.range_max_m)));
      continue;
    }
    const Point end = scan.end_of(beam);
    clear_along(from, end);
    add_weight(index_of(end), kHitWeight);
    if (static_cast<double>(scan.ranges_m[beam]) > kBoundsReach_m) continue;
    bounds_ = empty_ ? Box{end, end} : bounds_.widened(end);
    empty_ = false;
  }
}

void OccupancyMap::for_each(const std::function<void(const Cell&)>& visit) const {
  for (const auto& [at, weight] : weights_) {
    visit({{(at.column + 0.5) * kCell_m, (at.row + 0.5) * kCell_m}, weight >= kOccupiedFrom});
  }
}

}  // namespace gimnet::demo
