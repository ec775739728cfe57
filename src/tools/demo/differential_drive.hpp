#pragma once

#include "tools/demo/geometry.hpp"
#include "tools/demo/world_map.hpp"

namespace gimnet::demo {

/// Size and power of the simulated robot.
struct DriveSpec {
  double radius_m = 0.22;
  double wheel_distance_m = 0.36;
  double wheel_speed_max_mps = 1.2;
  double wheel_acceleration_mps2 = 2.5;
};

/// A robot on two driven wheels, in a hall. Wheels follow a command as fast as they accelerate;
/// walls stop the robot. Thread safety: one thread.
class DifferentialDrive {
 public:
  DifferentialDrive(const Pose& start, const DriveSpec& spec) : spec_(spec), pose_(start) {}

  /// Lets `dt_s` seconds pass under a command. A command beyond the wheels' speed is scaled down as
  /// a whole, so that the curve stays the same. REQUIRES: 0 < dt_s <= 0.1.
  void step(const Twist& command, double dt_s, const WorldMap& map);

  [[nodiscard]] const Pose& pose() const { return pose_; }
  /// How it really moves.
  [[nodiscard]] Twist twist() const;
  /// Did a wall stop it in the last step?
  [[nodiscard]] bool bumped() const { return bumped_; }

 private:
  DriveSpec spec_;
  Pose pose_;
  double left_mps_ = 0.0;
  double right_mps_ = 0.0;
  bool bumped_ = false;
};

}  // namespace gimnet::demo
