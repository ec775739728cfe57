#include "tools/demo/differential_drive.hpp"

#include <algorithm>
#include <cmath>

#include "base/check.hpp"

namespace gimnet::demo {
namespace {

double approach(double from, double to, double most) {
  return from + std::clamp(to - from, -most, most);
}

// Exact for constant wheel speeds: an arc, or a line where the arc's radius has no meaning any
// more.
Pose moved(const Pose& pose, const Twist& twist, double dt_s) {
  const double turn_rad = twist.angular_radps * dt_s;
  const double way_m = twist.linear_mps * dt_s;
  const double chord =
      std::abs(turn_rad) < 1e-9 ? 1.0 : std::sin(turn_rad / 2.0) / (turn_rad / 2.0);
  const double along_rad = pose.heading_rad + turn_rad / 2.0;
  return {pose.x_m + way_m * chord * std::cos(along_rad),
          pose.y_m + way_m * chord * std::sin(along_rad),
          normalized_angle(pose.heading_rad + turn_rad)};
}

}  // namespace

Twist DifferentialDrive::twist() const {
  return {(left_mps_ + right_mps_) / 2.0, (right_mps_ - left_mps_) / spec_.wheel_distance_m};
}

void DifferentialDrive::step(const Twist& command, double dt_s, const WorldMap& map) {
  GIMNET_ASSERT(dt_s > 0.0 && dt_s <= 0.1);
  const double half_turn_mps = command.angular_radps * spec_.wheel_distance_m / 2.0;
  double left_mps = command.linear_mps - half_turn_mps;
  double right_mps = command.linear_mps + half_turn_mps;
  const double fastest_mps = std::max(std::abs(left_mps), std::abs(right_mps));
  if (fastest_mps > spec_.wheel_speed_max_mps) {
    left_mps *= spec_.wheel_speed_max_mps / fastest_mps;
    right_mps *= spec_.wheel_speed_max_mps / fastest_mps;
  }
  const double most_mps = spec_.wheel_acceleration_mps2 * dt_s;
  left_mps_ = approach(left_mps_, left_mps, most_mps);
  right_mps_ = approach(right_mps_, right_mps, most_mps);

  const Pose next = moved(pose_, twist(), dt_s);
  bumped_ = map.touches_wall(position(next), spec_.radius_m);
  if (!bumped_) {
    pose_ = next;
    return;
  }
  // It may turn on the spot, to get away.
  const double turn_mps = (right_mps_ - left_mps_) / 2.0;
  left_mps_ = -turn_mps;
  right_mps_ = turn_mps;
  pose_.heading_rad = next.heading_rad;
}

}  // namespace gimnet::demo
