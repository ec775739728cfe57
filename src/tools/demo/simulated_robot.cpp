#include "tools/demo/simulated_robot.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

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
    odometry.pose = drive_.pose();
    odometry.twist = drive_.twist();
    odometry.bumped = drive_.bumped();
    odometry.answers = command_.stamp;
    output.on_odometry(odometry);
    if (++periods_ % kPeriodsPerScan != 0) continue;

    const LaserSpec& spec = laser_.spec();
    Scan scan;
    scan.pose = drive_.pose();
    scan.first_bearing_rad = spec.bearing_rad(0);
    scan.bearing_step_rad = spec.bearing_rad(1) - spec.bearing_rad(0);
    scan.range_max_m = spec.range_max_m;
    scan.ranges_m = laser_.scan(drive_.pose(), map_);
    output.on_scan(std::move(scan));
  }
}

RobotInfo SimulatedRobot::info() const {
  RobotInfo info;
  info.source = "simulation";
  info.map = map_.text();
  return info;
}

}  // namespace gimnet::demo
