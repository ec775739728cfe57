#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.hpp"
#include "tools/demo/geometry.hpp"

namespace gimnet::demo {

/// One ODOM or FLASER line of a log in the format of CARMEN
/// (carmen.sourceforge.net/logger_playback.html).
struct LogRecord {
  /// The robot's place by its odometry, or as the log was corrected.
  Pose pose;
  /// Seconds as logged; 0 where the line has none (a marker behind each scan of corrected logs has
  /// not).
  double stamp_s = 0.0;
  /// The time to play it, in seconds after the first record; ascending. Filled in by pace_log().
  double due_s = 0.0;
  /// Distances in metres, right to left over half a circle; empty for ODOM.
  std::vector<float> ranges_m;

  [[nodiscard]] bool is_scan() const { return !ranges_m.empty(); }
};

/// The records of a log, in its order.
struct RobotLog {
  std::vector<LogRecord> records;
  std::size_t scans = 0;
  /// A sentence for the user about how the playback is timed and what is left out; empty where the
  /// log is played as it is.
  std::string pacing_note;
  /// Lines that could not be read and were left out.
  std::uint64_t skipped = 0;
  /// The first of them: file, line number and what is wrong with it. Empty: there is none.
  std::string first_skipped;
  /// A sentence that the archive ends too early, with the number of lines read. Empty: it is whole.
  std::string cut;

  [[nodiscard]] double duration_s() const { return records.empty() ? 0.0 : records.back().due_s; }
};

inline constexpr std::size_t kLogBeamsMax = 4096;
inline constexpr std::size_t kLogRecordsMax = 4'000'000;
/// A distance from here on means that the beam met nothing: scanners of those days answer 81.83
/// or 81.91.
inline constexpr float kLogRangeMax_m = 50.0F;

/// The kind of a line.
enum class LineKind : std::uint8_t { kIgnored, kOdometry, kScan };

/// Reads one line. Comments, empty lines and other kinds of messages (PARAM, NEFF, RLASER, ...) are
/// ignored. Errors: a line that is none of these, wrong number of fields, a field that is no number
/// or out of range; the sentence says which, without file and line. Thread safety: any thread.
[[nodiscard]] Result<LineKind> parse_carmen_line(std::string_view line, LogRecord& record);

/// Reads a whole log, compressed or not, and paces it. Lines that cannot be read are skipped and
/// counted. Errors: those of the file, with the line number; a log without ODOM and FLASER lines.
[[nodiscard]] Result<RobotLog> load_robot_log(const std::string& path);

/// Longest pause that a playback keeps, in seconds: longer ones are gaps of the recording, not of
/// the drive, and are left out.
inline constexpr double kLongestPause_s = 5.0;
/// A playback begins this long before the robot first moves or scans, in seconds.
inline constexpr double kLeadIn_s = 1.0;
/// A shorter standing still at the beginning is played, in seconds.
inline constexpr double kShortestLeftOut_s = 5.0;

/// Fills in `due_s` of every record and the note. Records keep their order. The standing still at
/// the beginning is left out. If the stamps were rounded until nothing is left of them, the robot's
/// way sets the pace: 0.5 m/s and 0.8 rad/s. REQUIRES: at least one record.
void pace_log(RobotLog& log);

}  // namespace gimnet::demo
