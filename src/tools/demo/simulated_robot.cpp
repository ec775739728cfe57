#include "tools/demo/simulated_robot.hpp"

#include <algorithm>
#include <utility>

namespace gimnet::demo {

SimulatedRobot::SimulatedRobot(WorldMap map, std::int64_t start_ns)
    : map_(std::move(map)),
      drive_(map_.start(), DriveSpec{}),
      laser_(LaserSpec{}, 7),
      next_ns_(start_ns + kPeriod_ns) {}

void SimulatedRobot::handle(const DriveCommand& command, std::int64_t now_ns) {
  command_ = command;
  commanded_ns_ = now_ns;
}

void SimulatedRobot::advance(std::int64_t now_ns, const Output& output) {
  next_ns_ = std::max(next_ns_, now_ns - kCatchUp_ns);
  for (; next_ns_ <= now_ns; next_ns_ += kPeriod_ns) {
    const bool driven = next_ns_ - commanded_ns_ < kDeadMan_ns;
    drive_.step(driven ? command_.twist : Twist{}, static_cast<double>(kPeriod_ns) * 1e-9, map_);
    Odometry odometry;
    odometry.stamp = {++odometry_total_, now_ns};
    odometry.pose = drive_.pose();
    odometry.twist = drive_.twist();
    odometry.bumped = drive_.bumped();
    odometry.answers = command_.stamp;
    output.on_odometry(odometry);
    if (odometry_total_ % kPeriodsPerScan != 0) continue;

    const LaserSpec& spec = laser_.spec();
    Scan scan;
    scan.stamp = {++scan_total_, now_ns};
    scan.pose = drive_.pose();
    scan.first_bearing_rad = spec.bearing_rad(0);
    scan.bearing_step_rad = spec.bearing_rad(1) - spec.bearing_rad(0);
    scan.range_max_m = spec.range_max_m;
    scan.ranges_m = laser_.scan(drive_.pose(), map_);
    output.on_scan(scan);
  }
}

RobotInfo SimulatedRobot::info() const {
  RobotInfo info;
  info.source = "simulation";
  info.map = map_.text();
  return info;
}

}  // namespace gimnet::demo
