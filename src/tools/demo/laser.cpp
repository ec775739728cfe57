#include "tools/demo/laser.hpp"

#include <algorithm>

namespace gimnet::demo {

std::vector<float> Laser::scan(const Pose& pose, const WorldMap& map) {
  std::normal_distribution<double> noise(0.0, std::max(spec_.noise_m, 1e-9));
  std::vector<float> ranges_m;
  ranges_m.reserve(spec_.beams);
  for (std::size_t beam = 0; beam < spec_.beams; ++beam) {
    const Ray ray{position(pose), pose.heading_rad + spec_.bearing_rad(beam)};
    double range_m = map.distance_to_wall_m(ray, spec_.range_max_m);
    if (range_m < spec_.range_max_m)
      range_m = std::clamp(range_m + noise(random_), 0.0, spec_.range_max_m);
    ranges_m.push_back(static_cast<float>(range_m));
  }
  return ranges_m;
}

}  // namespace gimnet::demo
