#include "tools/demo/monitor.hpp"

namespace gimnet::demo {

void StreamRecord::take(std::uint64_t number, std::int64_t now_ns) {
  rate.add(now_ns);
  ++received;
  if (number <= last_number) {
    ++disordered;
    return;
  }
  if (last_number != 0 || !joined_late) missed += number - last_number - 1;
  last_number = number;
}

void Monitor::extend_trail(const Pose& pose) {
  const Point here = position(pose);
  if (!trail_.empty() && distance_m(trail_.back(), here) < kTrailStep_m) return;
  if (!trail_.empty()) way_m_ += distance_m(trail_.back(), here);
  if (trail_.size() >= kTrailPointsMax) {
    std::vector<Point> thinned;
    thinned.reserve(trail_.size() / 2 + 1);
    for (std::size_t index = 0; index < trail_.size(); index += 2) thinned.push_back(trail_[index]);
    trail_ = std::move(thinned);
  }
  trail_.push_back(here);
}

void Monitor::take(const Odometry& message, std::int64_t now_ns) {
  odometry_stream_.take(message.stamp.number, now_ns);
  odometry_age_.add(now_ns - message.stamp.made_ns);
  if (message.answers.number > answered_) {
    answered_ = message.answers.number;
    loop_age_.add(now_ns - message.answers.made_ns);
  }
  extend_trail(message.pose);
  odometry_ = message;
}

void Monitor::take(const Scan& message, std::int64_t now_ns) {
  scan_stream_.take(message.stamp.number, now_ns);
  scan_age_.add(now_ns - message.stamp.made_ns);
  scan_ = PlacedScan{message.pose, message.first_bearing_rad, message.bearing_step_rad,
                     message.range_max_m, message.ranges_m};
  seen_.add(*scan_);
}

void Monitor::take(const RobotInfo& message, std::int64_t) {
  if (!message.map.empty() && (!info_ || info_->map != message.map)) {
    Result<WorldMap> plan = WorldMap::parse(message.map);
    if (plan) {
      plan_ = std::move(*plan);
    } else {
      ++garbled_;
    }
  }
  info_ = message;
}

std::optional<Pose> Monitor::pose() const {
  if (odometry_) return odometry_->pose;
  return scan_ ? std::optional(scan_->pose) : std::nullopt;
}

void Monitor::sent(const DriveCommand& message, std::int64_t now_ns) {
  drive_stream_.take(message.stamp.number, now_ns);
}

}  // namespace gimnet::demo
