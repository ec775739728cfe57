#pragma once

#include <cstddef>
#include <cstdint>
#include <numbers>
#include <random>
#include <vector>

#include "tools/demo/geometry.hpp"
#include "tools/demo/robot.hpp"
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
  /// Its real speed.
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

/// The beams of a laser scanner: evenly over a field around the heading, right to left.
struct LaserSpec {
  std::size_t beams = 181;
  double field_rad = std::numbers::pi;
  double range_max_m = 10.0;
  /// Standard deviation of a distance.
  double noise_m = 0.008;

  /// Direction of a beam relative to the heading. REQUIRES: beam < beams, and at least 2 beams.
  [[nodiscard]] double bearing_rad(std::size_t beam) const {
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

/// A robot with a laser scanner in a hall: odometry at 40 Hz, scans at 10 Hz. Without a new command
/// for `kDeadMan_ns` it stops, as every robot should when its driver is gone.
class SimulatedRobot final : public RobotSource {
 public:
  static constexpr std::int64_t kPeriod_ns = 25'000'000;
  static constexpr int kPeriodsPerScan = 4;
  static constexpr std::int64_t kDeadMan_ns = 500'000'000;
  /// A stop of the process longer than this is not made up for.
  static constexpr std::int64_t kCatchUp_ns = 500'000'000;

  SimulatedRobot(WorldMap map, std::int64_t start_ns);

  void handle(const DriveCommand& command, std::int64_t now_ns) override;
  void advance(std::int64_t now_ns, const Output& output) override;
  [[nodiscard]] std::int64_t next_due_ns() const override { return next_ns_; }
  [[nodiscard]] RobotInfo info() const override;

 private:
  WorldMap map_;
  DifferentialDrive drive_;
  Laser laser_;
  std::int64_t next_ns_;
  std::int64_t commanded_ns_ = 0;
  DriveCommand command_;
  std::uint64_t periods_ = 0;
};

}  // namespace gimnet::demo
