#pragma once

#include <cstddef>
#include <numbers>
#include <random>
#include <vector>

#include "tools/demo/geometry.hpp"
#include "tools/demo/world_map.hpp"

namespace gimnet::demo {

/// How a laser scanner's beams lie: evenly over a field around the heading, right to left.
struct LaserSpec {
  std::size_t beams = 181;
  double field_rad = std::numbers::pi;
  double range_max_m = 10.0;
  /// Standard deviation of a distance.
  double noise_m = 0.008;

  /// Direction of a beam relative to the heading. REQUIRES: beam < beams.
  [[nodiscard]] double bearing_rad(std::size_t beam) const {
    if (beams < 2) return 0.0;
    return -field_rad / 2.0 +
           field_rad * static_cast<double>(beam) / static_cast<double>(beams - 1);
  }
};

/// A laser scanner in a hall, by casting rays. Thread safety: one thread.
class Laser {
 public:
  /// `seed` makes the noise repeatable.
  Laser(const LaserSpec& spec, unsigned seed) : spec_(spec), random_(seed) {}

  /// Distances in metres, one a beam; `range_max_m` where nothing is within reach.
  [[nodiscard]] std::vector<float> scan(const Pose& pose, const WorldMap& map);

  [[nodiscard]] const LaserSpec& spec() const { return spec_; }

 private:
  LaserSpec spec_;
  std::mt19937 random_;
};

}  // namespace gimnet::demo
