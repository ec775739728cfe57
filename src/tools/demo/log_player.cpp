#include "tools/demo/log_player.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

namespace gimnet::demo {
namespace {

// Logs give no usable speeds: the way of the last half second does.
constexpr double kTwistWindow_s = 0.5;

}  // namespace

LogPlayer::LogPlayer(RobotLog log, Start start)
    : log_(std::move(log)),
      source_(std::move(start.source)),
      speed_(start.speed),
      clock_ns_(start.start_ns) {}

void LogPlayer::let_time_pass(std::int64_t now_ns) {
  if (!paused_) played_s_ += speed_ * static_cast<double>(now_ns - clock_ns_) * 1e-9;
  played_s_ = std::min(played_s_, log_.duration_s());
  clock_ns_ = now_ns;
}

void LogPlayer::handle(const DriveCommand& command, std::int64_t now_ns) {
  let_time_pass(now_ns);
  speed_ = std::clamp(command.speed, kPlaySpeedMin, kPlaySpeedMax);
  paused_ = command.paused;
  answers_ = command.stamp;
}

Twist LogPlayer::twist_at(const LogRecord& record) {
  while (log_.records[twist_from_].due_s < record.due_s - kTwistWindow_s) ++twist_from_;
  const LogRecord& before = log_.records[twist_from_];
  const double dt_s = record.due_s - before.due_s;
  if (dt_s < 0.05) return {};
  const double dx_m = record.pose.x_m - before.pose.x_m;
  const double dy_m = record.pose.y_m - before.pose.y_m;
  const double ahead_m =
      dx_m * std::cos(record.pose.heading_rad) + dy_m * std::sin(record.pose.heading_rad);
  return {ahead_m / dt_s,
          normalized_angle(record.pose.heading_rad - before.pose.heading_rad) / dt_s};
}

void LogPlayer::say(const LogRecord& record, const Output& output) {
  if (!record.is_scan()) {
    Odometry odometry;
    odometry.pose = record.pose;
    odometry.twist = twist_at(record);
    odometry.answers = answers_;
    output.on_odometry(odometry);
    return;
  }
  Scan scan;
  scan.pose = record.pose;
  // n beams over half a circle: 180 are half a degree off centre each way, 181 and 361 reach both
  // ends.
  const auto beams = static_cast<double>(record.ranges_m.size());
  scan.bearing_step_rad =
      std::numbers::pi / (record.ranges_m.size() % 2 == 0 ? beams : std::max(1.0, beams - 1.0));
  scan.first_bearing_rad = -scan.bearing_step_rad * (beams - 1.0) / 2.0;
  scan.range_max_m = static_cast<double>(kLogRangeMax_m);
  scan.ranges_m = record.ranges_m;
  output.on_scan(std::move(scan));
}

void LogPlayer::advance(std::int64_t now_ns, const Output& output) {
  let_time_pass(now_ns);
  for (; next_ < log_.records.size() && log_.records[next_].due_s <= played_s_; ++next_) {
    say(log_.records[next_], output);
  }
}

std::int64_t LogPlayer::next_due_ns() const {
  if (paused_ || next_ >= log_.records.size()) return std::numeric_limits<std::int64_t>::max();
  const double wait_s = std::max(0.0, log_.records[next_].due_s - played_s_) / speed_;
  // One ns more, so that rounding never asks for a time at which nothing is due yet.
  return clock_ns_ + static_cast<std::int64_t>(std::ceil(wait_s * 1e9)) + 1;
}

RobotInfo LogPlayer::info() const {
  RobotInfo info;
  info.source = source_;
  info.note = log_.pacing_note;
  info.played_s = played_s_;
  info.duration_s = log_.duration_s();
  info.speed = speed_;
  info.paused = paused_;
  info.ended = next_ >= log_.records.size();
  return info;
}

}  // namespace gimnet::demo
