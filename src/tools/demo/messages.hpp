#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tools/demo/geometry.hpp"

namespace gimnet::demo {

// What the robot and its driver tell each other: Bitestream with text keys, so that any tool can
// print them.
//
//     robot/odom   provided by the robot, 40 a second   Odometry
//     robot/scan   provided by the robot, 10 a second   Scan
//     robot/info   provided by the robot, 2 a second    RobotInfo
//     robot/drive  accepted by the robot                DriveCommand
//
// Every message has a number, counted from 1 per service and sender, so that each end can tell what
// it missed, and the time at which it was made, so that the other can tell how old it is. Thread
// safety: pure functions. Errors: decode_...() gives nothing for bytes that are not such a message.
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
};

/// What the robot is, and how much it has said: the totals let a reader tell that it has
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

/// What the driver wants. Keys: n, t, v, w, speed, paused, finish.
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

[[nodiscard]] Bytes encode(const Odometry& message);
[[nodiscard]] Bytes encode(const Scan& message);
[[nodiscard]] Bytes encode(const RobotInfo& message);
[[nodiscard]] Bytes encode(const DriveCommand& message);

[[nodiscard]] std::optional<Odometry> decode_odometry(std::span<const std::byte> bytes);
[[nodiscard]] std::optional<Scan> decode_scan(std::span<const std::byte> bytes);
[[nodiscard]] std::optional<RobotInfo> decode_info(std::span<const std::byte> bytes);
[[nodiscard]] std::optional<DriveCommand> decode_drive(std::span<const std::byte> bytes);

}  // namespace gimnet::demo
