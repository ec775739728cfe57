#include "tools/demo/driver.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "tools/demo/log_player.hpp"

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

namespace {

constexpr double kSpeeds[] = {kPlaySpeedMin, 0.25, 0.5,  1.0,  2.0,
                              5.0,           10.0, 20.0, 50.0, kPlaySpeedMax};

double faster_than(double speed) {
  const double* next = std::upper_bound(std::begin(kSpeeds), std::end(kSpeeds), speed);
  return next == std::end(kSpeeds) ? kPlaySpeedMax : *next;
}

double slower_than(double speed) {
  const double* same = std::lower_bound(std::begin(kSpeeds), std::end(kSpeeds), speed);
  return same == std::begin(kSpeeds) ? kPlaySpeedMin : *std::prev(same);
}

bool plays_log(const Monitor& monitor) { return monitor.info() && monitor.info()->is_log(); }

}  // namespace

void Driver::change_speed(double speed) {
  speed_ = speed;
  changed_ = true;
}

void Driver::press(Keystroke key, const Monitor& monitor, std::int64_t now_ns) {
  if (plays_log(monitor)) {
    const double speed = speed_.value_or(monitor.info()->speed);
    if (key == Keystroke::kFaster) change_speed(faster_than(speed));
    if (key == Keystroke::kSlower) change_speed(slower_than(speed));
    if (key == Keystroke::kStop) {
      paused_ = !paused_;
      changed_ = true;
    }
    return;
  }
  if (key == Keystroke::kAutopilot) autopilot_ = !autopilot_;
  const bool drives = key == Keystroke::kForward || key == Keystroke::kBack ||
                      key == Keystroke::kLeft || key == Keystroke::kRight ||
                      key == Keystroke::kStop;
  // A key takes the wheel from the course.
  if (drives) autopilot_ = false;
  teleop_.press(key, now_ns);
}

Twist Driver::wanted(const Monitor& monitor, std::int64_t now_ns) {
  if (!autopilot_) return teleop_.twist(now_ns);
  if (!course_ && monitor.plan()) course_.emplace(monitor.plan()->waypoints());
  if (!course_ || !monitor.odometry()) return {};
  return course_->steer(monitor.odometry()->pose);
}

std::optional<DriveCommand> Driver::next(const Monitor& monitor, std::int64_t now_ns) {
  if (finish_said_ || !monitor.info()) return std::nullopt;
  const bool due = plays_log(monitor) ? changed_ : now_ns >= next_ns_;
  if (!due && !finish_) return std::nullopt;
  next_ns_ = std::max(next_ns_ + kPeriod_ns, now_ns - kPeriod_ns);
  changed_ = false;
  finish_said_ = finish_;
  DriveCommand command;
  command.stamp = {++number_, now_ns};
  command.speed = speed_.value_or(monitor.info()->speed);
  command.paused = paused_;
  command.finish = finish_;
  if (!finish_ && !plays_log(monitor)) command.twist = wanted(monitor, now_ns);
  return command;
}

}  // namespace gimnet::demo
