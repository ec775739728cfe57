#include "tools/demo/log_pacing.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <vector>

namespace gimnet::demo {
namespace {

constexpr double kPaceLinear_mps = 0.5;
constexpr double kPaceAngular_radps = 0.8;
constexpr double kPaceLeastStep_s = 0.05;
constexpr double kMoved_m = 0.01;
constexpr double kTurned_rad = 0.01;

// Stamps can be used if enough of them differ: a log with seconds since 1970 printed in six digits
// has a handful.
bool stamps_usable(const RobotLog& log) {
  std::set<double> different;
  std::size_t stamped = 0;
  for (const LogRecord& record : log.records) {
    if (record.stamp_s == 0.0) continue;
    ++stamped;
    different.insert(record.stamp_s);
  }
  return stamped > 0 && (different.size() * 4 >= stamped || stamped < 4);
}

// A stamp far from the ones before and behind it is a slip of the recorder, not a time.
bool is_slip(double stamp_s, std::optional<double> before_s, std::optional<double> behind_s) {
  const auto far_from = [stamp_s](std::optional<double> other_s) {
    return other_s && std::abs(stamp_s - *other_s) > kLongestPause_s;
  };
  return far_from(before_s) && (far_from(behind_s) || !behind_s);
}

// The stamps that can be followed; 0 for records without one.
std::vector<double> followed_stamps(const RobotLog& log) {
  std::vector<double> stamps(log.records.size(), 0.0);
  std::optional<double> before_s;
  std::size_t behind = 0;
  for (std::size_t index = 0; index < stamps.size(); ++index) {
    const double stamp_s = log.records[index].stamp_s;
    if (stamp_s == 0.0) continue;
    behind = std::max(behind, index + 1);
    while (behind < stamps.size() && log.records[behind].stamp_s == 0.0) ++behind;
    const std::optional<double> behind_s =
        behind < stamps.size() ? std::optional(log.records[behind].stamp_s) : std::nullopt;
    if (is_slip(stamp_s, before_s, behind_s)) continue;
    stamps[index] = stamp_s;
    before_s = stamp_s;
  }
  return stamps;
}

void pace_by_stamps(RobotLog& log) {
  const std::vector<double> stamps = followed_stamps(log);
  double due_s = 0.0;
  double clock_s = 0.0;
  bool started = false;
  for (std::size_t index = 0; index < stamps.size(); ++index) {
    const double stamp_s = stamps[index];
    if (stamp_s != 0.0) {
      if (started && stamp_s > clock_s) due_s += std::min(stamp_s - clock_s, kLongestPause_s);
      // Far back is another clock, to be followed from here on; a little back is a merge that was
      // not quite in order.
      const bool other_clock = stamp_s < clock_s - kLongestPause_s;
      clock_s = started && !other_clock ? std::max(clock_s, stamp_s) : stamp_s;
      started = true;
    }
    log.records[index].due_s = due_s;
  }
}

void pace_by_way(RobotLog& log) {
  double due_s = 0.0;
  const LogRecord* before = nullptr;
  for (LogRecord& record : log.records) {
    if (before != nullptr && record.stamp_s != 0.0) {
      const double way_m = distance_m(position(record.pose), position(before->pose));
      const double turn_rad =
          std::abs(normalized_angle(record.pose.heading_rad - before->pose.heading_rad));
      const double step_s =
          std::max({kPaceLeastStep_s, way_m / kPaceLinear_mps, turn_rad / kPaceAngular_radps});
      due_s += std::min(step_s, kLongestPause_s);
    }
    record.due_s = due_s;
    before = &record;
  }
}

// Seconds from the first record to the one at which something happens.
double first_event_s(const RobotLog& log) {
  const Pose& start = log.records.front().pose;
  for (const LogRecord& record : log.records) {
    const bool moved =
        distance_m(position(record.pose), position(start)) > kMoved_m ||
        std::abs(normalized_angle(record.pose.heading_rad - start.heading_rad)) > kTurned_rad;
    if (moved || record.is_scan()) return record.due_s;
  }
  return 0.0;
}

}  // namespace

void pace_log(RobotLog& log) {
  if (stamps_usable(log)) {
    pace_by_stamps(log);
  } else {
    pace_by_way(log);
    log.pacing_note =
        "the log's time stamps are rounded too far to follow: paced by the robot's way at 0.5 m/s";
  }
  const double left_out_s = first_event_s(log) - kLeadIn_s;
  if (left_out_s < kShortestLeftOut_s) return;
  std::erase_if(log.records,
                [left_out_s](const LogRecord& record) { return record.due_s < left_out_s; });
  for (LogRecord& record : log.records) record.due_s -= left_out_s;
  if (!log.pacing_note.empty()) log.pacing_note += "; ";
  log.pacing_note +=
      fmt::format("left out the first {:.0f} s, in which the robot stands still", left_out_s);
}

}  // namespace gimnet::demo
