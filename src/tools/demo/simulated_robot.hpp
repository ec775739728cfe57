#pragma once

#include <cstdint>

#include "tools/demo/differential_drive.hpp"
#include "tools/demo/laser.hpp"
#include "tools/demo/robot_source.hpp"
#include "tools/demo/world_map.hpp"

namespace gimnet::demo {

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
  std::uint64_t odometry_total_ = 0;
  std::uint64_t scan_total_ = 0;
};

}  // namespace gimnet::demo
