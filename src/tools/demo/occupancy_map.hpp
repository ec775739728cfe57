#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <unordered_map>
#include <vector>

#include "tools/demo/geometry.hpp"

namespace gimnet::demo {

/// A laser scan where it was taken.
struct PlacedScan {
  Pose pose;
  /// Direction of the first beam relative to the heading, and from each beam to the next.
  double first_bearing_rad = 0.0;
  double bearing_step_rad = 0.0;
  /// From here on a distance means that the beam met nothing.
  double range_max_m = 0.0;
  std::vector<float> ranges_m;

  /// Where a beam ended. REQUIRES: beam < ranges_m.size().
  [[nodiscard]] Point end_of(std::size_t beam) const;
  [[nodiscard]] bool hit(std::size_t beam) const {
    return static_cast<double>(ranges_m[beam]) < range_max_m;
  }
};

/// A picture of the world built from scans: squares that beams ended in, and squares that they
/// passed. Each square keeps a weight, so that what moves away fades (Moravec and Elfes, "High
/// Resolution Maps from Wide Angle Sonar", 1985). Grows where scans reach. Thread safety: one
/// thread. Limits: `kChunksMax` pieces, about 64 MiB; beyond them what is new is not drawn.
class OccupancyMap {
 public:
  static constexpr double kCell_m = 0.1;
  static constexpr std::size_t kChunksMax = 16'384;
  /// A beam that met nothing still shows that this much before it is free.
  static constexpr double kFreeWithoutHit_m = 4.0;

  /// What is farther away from the scanner does not widen the bounds: far hits are few, and often
  /// wrong.
  static constexpr double kBoundsReach_m = 15.0;

  void add(const PlacedScan& scan);

  /// A square that is not unknown.
  struct Cell {
    Point centre;
    bool occupied = false;
  };
  void for_each(const std::function<void(const Cell&)>& visit) const;

  /// Smallest and largest coordinates of what beams ended in; valid only if !empty().
  [[nodiscard]] const Point& least() const { return least_; }
  [[nodiscard]] const Point& most() const { return most_; }
  [[nodiscard]] bool empty() const { return empty_; }

 private:
  static constexpr long kChunkCells = 64;
  using Chunk = std::array<std::int8_t, static_cast<std::size_t>(kChunkCells* kChunkCells)>;

  struct Index {
    long column = 0;
    long row = 0;
    bool operator==(const Index&) const = default;
  };
  struct IndexHash {
    std::size_t operator()(const Index& index) const;
  };

  static Index index_of(const Point& point);
  std::int8_t* weight_of(const Index& index);
  void clear_along(const Point& from, const Point& to);
  void mark(const Point& point);
  void widen(const Point& point);

  std::unordered_map<Index, Chunk, IndexHash> chunks_;
  Point least_;
  Point most_;
  bool empty_ = true;
};

}  // namespace gimnet::demo
