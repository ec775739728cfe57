#include "tools/demo/monitor.hpp"

#include <algorithm>
#include <cmath>

namespace gimnet::demo {

void SampleWindow::add(std::int64_t duration_ns) {
  if (samples_.size() < capacity_) {
    samples_.push_back(duration_ns);
    return;
  }
  samples_[oldest_] = duration_ns;
  oldest_ = (oldest_ + 1) % capacity_;
}

std::optional<std::int64_t> SampleWindow::percentile_ns(double percent) const {
  if (samples_.empty()) return std::nullopt;
  std::vector<std::int64_t> sorted = samples_;
  const double rank = std::ceil(percent / 100.0 * static_cast<double>(sorted.size()));
  const auto index =
      static_cast<std::size_t>(std::clamp(rank, 1.0, static_cast<double>(sorted.size()))) - 1;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(index),
                   sorted.end());
  return sorted[index];
}

std::vector<std::int64_t> SampleWindow::latest(std::size_t count) const {
  std::vector<std::int64_t> ordered;
  const std::size_t size = samples_.size();
  const std::size_t taken = std::min(count, size);
  for (std::size_t index = size - taken; index < size; ++index)
    ordered.push_back(samples_[(oldest_ + index) % size]);
  return ordered;
}

void RateMeter::add(std::int64_t now_ns) {
  if (!first_ns_) first_ns_ = now_ns;
  std::erase_if(times_ns_,
                [now_ns](std::int64_t time_ns) { return time_ns <= now_ns - kWindow_ns; });
  times_ns_.push_back(now_ns);
}

double RateMeter::rate_hz(std::int64_t now_ns) const {
  const auto recent =
      std::count_if(times_ns_.begin(), times_ns_.end(),
                    [now_ns](std::int64_t time_ns) { return time_ns > now_ns - kWindow_ns; });
  if (recent == 0) return 0.0;
  // Until the window is full the first event opens the interval and is not in it.
  const std::int64_t open_ns = now_ns - *first_ns_;
  if (open_ns < kWindow_ns)
    return open_ns < 100'000'000
               ? 0.0
               : static_cast<double>(recent - 1) / (static_cast<double>(open_ns) * 1e-9);
  return static_cast<double>(recent) / (static_cast<double>(kWindow_ns) * 1e-9);
}

void StreamRecord::take(const Stamp& stamp, std::int64_t now_ns, const Excuse& excuse) {
  rate.add(now_ns);
  ++received;
  if (stamp.number <= last_number) {
    ++disordered;
    return;
  }
  const bool begins = last_number == 0 && joined_late;
  if (!begins) miss(stamp.number - last_number - 1, stamp.made_ns, excuse);
  last_number = stamp.number;
  last_made_ns = stamp.made_ns;
}

/// Messages of a stream are made at equal distances, so those that are missing between two were
/// made at equal distances between them.
void StreamRecord::miss(std::uint64_t count, std::int64_t until_ns, const Excuse& excuse) {
  constexpr std::uint64_t kLookedAtMax = 10'000;  // what a stream loses in minutes
  missed += count;
  if (!excuse || last_number == 0) return;
  const double step_ns =
      static_cast<double>(until_ns - last_made_ns) / (static_cast<double>(count) + 1.0);
  for (std::uint64_t index = 1; index <= std::min(count, kLookedAtMax); ++index) {
    const auto after_ns = static_cast<std::int64_t>(step_ns * static_cast<double>(index));
    if (excuse(last_made_ns + after_ns)) ++excused;
  }
}

void Monitor::extend_trail(const Pose& pose) {
  const Point here = position(pose);
  if (!trail_.empty() && distance_m(trail_.back(), here) < kTrailStep_m) return;
  if (!trail_.empty()) way_m_ += distance_m(trail_.back(), here);
  if (trail_.size() >= kTrailPointsMax) {
    for (std::size_t index = 0; index < trail_.size() / 2; ++index)
      trail_[index] = trail_[2 * index];
    trail_.resize(trail_.size() / 2);
  }
  trail_.push_back(here);
}

void Monitor::take(const Odometry& message, std::int64_t now_ns) {
  odometry_stream_.take(message.stamp, now_ns, excuse_);
  odometry_stream_.age.add(now_ns - message.stamp.made_ns);
  if (message.answers.number > answered_) {
    answered_ = message.answers.number;
    drive_stream_.age.add(now_ns - message.answers.made_ns);
  }
  extend_trail(message.pose);
  odometry_ = message;
}

void Monitor::take(const Scan& message, std::int64_t now_ns) {
  scan_stream_.take(message.stamp, now_ns, excuse_);
  scan_stream_.age.add(now_ns - message.stamp.made_ns);
  scan_ = message;
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
  drive_stream_.take(message.stamp, now_ns, excuse_);
}

}  // namespace gimnet::demo
