#include "tools/demo/occupancy_map.hpp"

#include <algorithm>
#include <cmath>

namespace gimnet::demo {
namespace {

constexpr int kHitWeight = 24;
constexpr int kPassWeight = 6;
constexpr int kWeightMax = 96;
constexpr int kOccupiedFrom = 12;

void add_weight(std::int8_t& weight, int change) {
  int sum = std::clamp(weight + change, -kWeightMax, kWeightMax);
  // 0 means unknown: what was seen once stays seen.
  if (sum == 0) sum = change > 0 ? 1 : -1;
  weight = static_cast<std::int8_t>(sum);
}

long floor_divided(long value, long by) {
  return value >= 0 ? value / by : -((by - 1 - value) / by);
}

}  // namespace

Point PlacedScan::end_of(std::size_t beam) const {
  const double bearing_rad = first_bearing_rad + bearing_step_rad * static_cast<double>(beam);
  return point_along({position(pose), pose.heading_rad + bearing_rad},
                     static_cast<double>(ranges_m[beam]));
}

std::size_t OccupancyMap::IndexHash::operator()(const Index& index) const {
  const auto mixed = static_cast<std::uint64_t>(index.column) * 0x9E3779B97F4A7C15ULL +
                     static_cast<std::uint64_t>(index.row) * 0xC2B2AE3D27D4EB4FULL;
  return static_cast<std::size_t>(mixed ^ (mixed >> 29U));
}

OccupancyMap::Index OccupancyMap::index_of(const Point& point) {
  return {static_cast<long>(std::floor(point.x_m / kCell_m)),
          static_cast<long>(std::floor(point.y_m / kCell_m))};
}

std::int8_t* OccupancyMap::weight_of(const Index& index) {
  const Index at{floor_divided(index.column, kChunkCells), floor_divided(index.row, kChunkCells)};
  auto found = chunks_.find(at);
  if (found == chunks_.end()) {
    if (chunks_.size() >= kChunksMax) return nullptr;
    found = chunks_.emplace(at, Chunk{}).first;
  }
  const long column = index.column - at.column * kChunkCells;
  const long row = index.row - at.row * kChunkCells;
  return &found->second[static_cast<std::size_t>(row * kChunkCells + column)];
}

// Steps of half a square: no square of any length on the way is left out, and none before the end
// is taken twice often enough to matter.
void OccupancyMap::clear_along(const Point& from, const Point& to) {
  const double length_m = distance_m(from, to);
  const auto steps = static_cast<long>(length_m / (kCell_m / 2.0));
  const Index last = index_of(to);
  Index before{};
  bool first = true;
  for (long step = 0; step < steps; ++step) {
    const double part = static_cast<double>(step) / static_cast<double>(steps);
    const Index at =
        index_of({from.x_m + part * (to.x_m - from.x_m), from.y_m + part * (to.y_m - from.y_m)});
    if (at == last || (!first && at == before)) continue;
    first = false;
    before = at;
    if (std::int8_t* weight = weight_of(at)) add_weight(*weight, -kPassWeight);
  }
}

void OccupancyMap::mark(const Point& point) {
  std::int8_t* weight = weight_of(index_of(point));
  if (weight != nullptr) add_weight(*weight, kHitWeight);
}

void OccupancyMap::widen(const Point& point) {
  if (empty_) least_ = most_ = point;
  empty_ = false;
  least_ = {std::min(least_.x_m, point.x_m), std::min(least_.y_m, point.y_m)};
  most_ = {std::max(most_.x_m, point.x_m), std::max(most_.y_m, point.y_m)};
}

void OccupancyMap::add(const PlacedScan& scan) {
  for (std::size_t beam = 0; beam < scan.ranges_m.size(); ++beam) {
    if (scan.hit(beam)) {
      clear_along(position(scan.pose), scan.end_of(beam));
      mark(scan.end_of(beam));
      if (static_cast<double>(scan.ranges_m[beam]) <= kBoundsReach_m) widen(scan.end_of(beam));
      continue;
    }
    const double bearing_rad =
        scan.first_bearing_rad + scan.bearing_step_rad * static_cast<double>(beam);
    const Ray ray{position(scan.pose), scan.pose.heading_rad + bearing_rad};
    clear_along(position(scan.pose),
                point_along(ray, std::min(kFreeWithoutHit_m, scan.range_max_m)));
  }
}

void OccupancyMap::for_each(const std::function<void(const Cell&)>& visit) const {
  for (const auto& [at, chunk] : chunks_) {
    for (long offset = 0; offset < kChunkCells * kChunkCells; ++offset) {
      const std::int8_t weight = chunk[static_cast<std::size_t>(offset)];
      if (weight == 0) continue;
      const long column = at.column * kChunkCells + offset % kChunkCells;
      const long row = at.row * kChunkCells + offset / kChunkCells;
      visit({{(static_cast<double>(column) + 0.5) * kCell_m,
              (static_cast<double>(row) + 0.5) * kCell_m},
             weight >= kOccupiedFrom});
    }
  }
}

}  // namespace gimnet::demo
