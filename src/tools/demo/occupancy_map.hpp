#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <unordered_map>

#include "tools/demo/geometry.hpp"
#include "tools/demo/messages.hpp"

namespace gimnet::demo {

/// A picture of the world built from scans: squares that beams ended in, and squares that they
/// passed. Each square keeps a weight, so that things that move away fade (Moravec and Elfes, "High
/// Resolution Maps from Wide Angle Sonar", 1985). Grows where scans reach. Thread safety: one
/// thread. Limits: `kCellsMax` squares; beyond them nothing new is drawn.
class OccupancyMap {
 public:
  static constexpr double kCell_m = 0.1;
  /// 20,000 square metres, about 100 MiB.
  static constexpr std::size_t kCellsMax = 2'000'000;
  /// A beam that met nothing still shows that this much before it is free.
  static constexpr double kFreeWithoutHit_m = 4.0;
  /// Hits farther away from the scanner do not widen the bounds: they are few, and often wrong.
  static constexpr double kBoundsReach_m = 15.0;

  void add(const Scan& scan);

  /// A square that is not unknown.
  struct Cell {
    Point centre;
    bool occupied = false;
  };
  void for_each(const std::function<void(const Cell&)>& visit) const;

  /// The rectangle of all squares in which beams ended; valid only if !empty().
  [[nodiscard]] const Box& bounds() const { return bounds_; }
  [[nodiscard]] bool empty() const { return empty_; }

 private:
  struct Index {
    std::int32_t column = 0;
    std::int32_t row = 0;
    bool operator==(const Index&) const = default;
  };
  struct IndexHash {
    std::size_t operator()(const Index& index) const;
  };

  static Index index_of(const Point& point);
  void add_weight(const Index& index, int change);
  void clear_along(const Point& from, const Point& to);

  std::unordered_map<Index, std::int8_t, IndexHash> weights_;
  Box bounds_;
  bool empty_ = true;
};

}  // namespace gimnet::demo
