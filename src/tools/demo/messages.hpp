#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tools/demo/geometry.hpp"

namespace gimnet::demo {

// The messages between the robot and its driver: Bitestream with text keys, so that any tool can
// print them.
//
//     robot/odom   provided by the robot, 40 a second   Odometry
//     robot/scan   provided by the robot, 10 a second   Scan
//     robot/info   provided by the robot, 2 a second    RobotInfo
//     robot/drive  accepted by the robot                DriveCommand
//
// Every message has a number, counted from 1 per service and sender, so that each end can tell what
// it missed, and the time at which it was made, so that the other can tell how old it is. Thread
// safety: pure functions. Errors: decode() gives nothing for bytes that are not such a message.
// Limits: `kScanBeamsMax` beams, `kInfoTextMax` bytes of map text.

inline constexpr std::size_t kScanBeamsMax = 4096;
inline constexpr std::size_t kInfoTextMax = std::size_t{64} << 10;

/// Number and time (ns since 1970) of a message.
struct Stamp {
  std::uint64_t number = 0;
  std::int64_t made_ns = 0;
};

/// Keys: n, t, x, y, heading, v, w, bumped, answers_n, answers_t.
struct Odometry {
  Stamp stamp;
  Pose pose;
  Twist twist;
  bool bumped = false;
  /// The command under which the robot moves; number 0: none. Its age is the time of the whole
  /// loop.
  Stamp answers;
};

/// Keys: n, t, x, y, heading, first, step, reach, ranges.
struct Scan {
  Stamp stamp;
  Pose pose;
  double first_bearing_rad = 0.0;
  double bearing_step_rad = 0.0;
  /// A distance from here on means that the beam met nothing.
  double range_max_m = 0.0;
  std::vector<float> ranges_m;

  [[nodiscard]] Ray ray(std::size_t beam) const {
    return {position(pose),
            pose.heading_rad + first_bearing_rad + bearing_step_rad * static_cast<double>(beam)};
  }
  /// REQUIRES: beam < ranges_m.size().
  [[nodiscard]] bool hit(std::size_t beam) const {
    return static_cast<double>(ranges_m[beam]) < range_max_m;
  }
  /// The place at which a beam ended. REQUIRES: beam < ranges_m.size().
  [[nodiscard]] Point end_of(std::size_t beam) const {
    return point_along(ray(beam), static_cast<double>(ranges_m[beam]));
  }
};

/// A description of the robot, and the totals of its messages: they let a reader tell that it has
/// everything. Keys: n, t, source, note, map, played, duration, speed, paused, ended, odom_total,
/// scan_total, drive_total.
struct RobotInfo {
  Stamp stamp;
  /// "simulation", or the name of the log.
  std::string source;
  /// A sentence for the user; may be empty.
  std::string note;
  /// Text of a WorldMap; empty for a log.
  std::string map;
  /// Seconds of the log that were played, and that there are; 0 for a simulation.
  double played_s = 0.0;
  double duration_s = 0.0;
  double speed = 1.0;
  bool paused = false;
  /// Nothing more comes: the log is over, or the driver said so.
  bool ended = false;
  std::uint64_t odometry_total = 0;
  std::uint64_t scan_total = 0;
  std::uint64_t drive_total = 0;

  [[nodiscard]] bool is_log() const { return map.empty(); }
};

/// The driver's wish. Keys: n, t, v, w, speed, paused, finish.
struct DriveCommand {
  Stamp stamp;
  Twist twist;
  /// For a log: how many times faster than recorded, and whether to hold it.
  double speed = 1.0;
  bool paused = false;
  /// Send nothing more but a last RobotInfo.
  bool finish = false;
};

using Bytes = std::vector<std::byte>;

/// Message: Odometry, Scan, RobotInfo or DriveCommand.
template <class Message>
[[nodiscard]] Bytes encode(const Message& message);
template <class Message>
[[nodiscard]] std::optional<Message> decode(std::span<const std::byte> bytes);

}  // namespace gimnet::demo
