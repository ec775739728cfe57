#include "tools/demo/course.hpp"

#include <algorithm>
#include <cmath>

namespace gimnet::demo {
namespace {

constexpr double kReached_m = 0.35;
constexpr double kCruise_mps = 1.0;
constexpr double kTurnGain_per_s = 2.5;
constexpr double kTurnMax_radps = 1.8;
// Beyond this angle it turns on the spot.
constexpr double kTurnFirst_rad = 0.9;

}  // namespace

Twist Course::steer(const Pose& pose) {
  if (corners_.empty()) return {};
  if (distance_m(position(pose), corners_[next_]) < kReached_m) {
    next_ = (next_ + 1) % corners_.size();
    ++reached_;
  }
  const Point& target = corners_[next_];
  const double direction_rad = std::atan2(target.y_m - pose.y_m, target.x_m - pose.x_m);
  const double error_rad = normalized_angle(direction_rad - pose.heading_rad);
  const double ahead = std::max(0.0, 1.0 - std::abs(error_rad) / kTurnFirst_rad);
  return {kCruise_mps * ahead,
          std::clamp(kTurnGain_per_s * error_rad, -kTurnMax_radps, kTurnMax_radps)};
}

}  // namespace gimnet::demo
