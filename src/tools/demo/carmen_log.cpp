#include "tools/demo/carmen_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <set>
#include <vector>

#include "tools/demo/line_reader.hpp"

namespace gimnet::demo {
namespace {

// Bytes that may be anything, as a person can read them.
std::string quoted(std::string_view text) {
  constexpr std::size_t kShown = 24;
  std::string shown;
  for (const char c : text.substr(0, kShown)) {
    if (c >= ' ' && c <= '~') {
      shown += c;
    } else {
      shown += fmt::format("\\x{:02x}", static_cast<unsigned char>(c));
    }
  }
  return fmt::format("\"{}{}\"", shown, text.size() > kShown ? "..." : "");
}

struct Range {
  double least;
  double most;
};

constexpr Range kPosition{-1e6, 1e6};
constexpr Range kAngle{-1e4, 1e4};
constexpr Range kDistance{0.0, 1e4};
constexpr Range kSpeed{-1e4, 1e4};
constexpr Range kStamp{0.0, 1e11};

// Reads the words of a line, blanks between them as fscanf takes them, and named numbers from them.
// Keeps the first complaint; after it, everything answers 0.
class WordScanner {
 public:
  explicit WordScanner(std::string_view line) : rest_(line) { message_ = next_word(); }

  /// The first word; empty: there is none.
  [[nodiscard]] std::string_view message() const { return message_; }

  double number(std::string_view name, const Range& range) {
    const std::string_view word = next(name);
    if (word.empty()) return 0.0;
    double value = 0.0;
    const auto [end, code] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (code != std::errc{} || end != word.data() + word.size() || !std::isfinite(value)) {
      complain(fmt::format("{}: {} is {}, which is no number", message_, name, quoted(word)));
    } else if (value < range.least || value > range.most) {
      complain(fmt::format("{}: {} is {}, outside {} .. {}", message_, name, value, range.least,
                           range.most));
    }
    return complaint_.empty() ? value : 0.0;
  }

  Pose pose(std::string_view prefix) {
    Pose pose;
    pose.x_m = number(fmt::format("{}x", prefix), kPosition);
    pose.y_m = number(fmt::format("{}y", prefix), kPosition);
    pose.heading_rad = normalized_angle(number(fmt::format("{}theta", prefix), kAngle));
    return pose;
  }

  void skip_word(std::string_view name) { (void)next(name); }

  void end() {
    if (!next_word().empty())
      complain(fmt::format("{}: more fields than it should have", message_));
  }

  void complain(std::string sentence) {
    if (complaint_.empty()) complaint_ = std::move(sentence);
  }

  [[nodiscard]] const std::string& complaint() const { return complaint_; }

 private:
  std::string_view next_word() {
    rest_.remove_prefix(std::min(rest_.find_first_not_of(" \t"), rest_.size()));
    const std::string_view word = rest_.substr(0, rest_.find_first_of(" \t"));
    rest_.remove_prefix(word.size());
    return word;
  }
  std::string_view next(std::string_view name) {
    if (!complaint_.empty()) return {};
    const std::string_view word = next_word();
    if (word.empty())
      complain(fmt::format("{}: the line ends before {}; was it cut?", message_, name));
    return word;
  }

  std::string_view rest_;
  std::string_view message_;
  std::string complaint_;
};

// x y theta tv rv accel stamp host logger_stamp
void read_odometry(WordScanner& fields, LogRecord& record) {
  record.pose = fields.pose("");
  (void)fields.number("tv", kSpeed);
  (void)fields.number("rv", kSpeed);
  (void)fields.number("accel", kSpeed);
  record.stamp_s = fields.number("timestamp", kStamp);
  fields.skip_word("host");
  (void)fields.number("logger timestamp", kStamp);
  fields.end();
}

// count ranges... x y theta odom_x odom_y odom_theta stamp host logger_stamp
void read_scan(WordScanner& fields, LogRecord& record) {
  const double beams = fields.number("number of beams", {1.0, static_cast<double>(kLogBeamsMax)});
  if (beams != std::floor(beams))
    fields.complain(fmt::format("FLASER: {} is no number of beams", beams));
  if (!fields.complaint().empty()) return;
  record.ranges_m.resize(static_cast<std::size_t>(beams));
  for (float& range : record.ranges_m)
    range = static_cast<float>(fields.number("range", kDistance));
  record.pose = fields.pose("");
  (void)fields.pose("odom_");
  record.stamp_s = fields.number("timestamp", kStamp);
  fields.skip_word("host");
  (void)fields.number("logger timestamp", kStamp);
  fields.end();
}

// Names of CARMEN messages: capitals, then capitals, digits and underscores.
bool is_message_name(std::string_view word) {
  for (const char c : word) {
    if (!((c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_')) return false;
  }
  return !word.empty() && word.size() <= 64 && word.front() >= 'A' && word.front() <= 'Z';
}

}  // namespace

Result<LineKind> parse_carmen_line(std::string_view line, LogRecord& record) {
  WordScanner fields(line);
  const std::string_view name = fields.message();
  record = LogRecord{};
  if (name == "ODOM") {
    read_odometry(fields, record);
  } else if (name == "FLASER") {
    read_scan(fields, record);
  } else if (name.empty() || name.front() == '#' || is_message_name(name)) {
    return LineKind::kIgnored;
  } else {
    return Error{fmt::format(
        "the line begins with {}, which is no CARMEN message (expected ODOM, FLASER, PARAM, ...)",
        quoted(name))};
  }
  if (!fields.complaint().empty()) return Error{fields.complaint()};
  return name == "FLASER" ? LineKind::kScan : LineKind::kOdometry;
}

Result<RobotLog> load_robot_log(const std::string& path) {
  Result<LineReader> reader = LineReader::open(path);
  if (!reader) return reader.error();
  RobotLog log;
  std::string_view line;
  while (true) {
    const Result<bool> more = reader->next(line);
    if (!more) return more.error();
    if (!*more) break;
    LogRecord record;
    const Result<LineKind> kind = reader->is_too_long() ? Error{"the line is longer than 1 MiB"}
                                                        : parse_carmen_line(line, record);
    if (!kind) {
      if (log.skipped++ == 0) {
        log.first_skipped =
            fmt::format("{}:{}: {}", path, reader->line_number(), kind.error().sentence);
      }
      continue;
    }
    if (*kind == LineKind::kIgnored) continue;
    if (*kind == LineKind::kScan) ++log.scans;
    log.records.push_back(std::move(record));
    if (log.records.size() > kLogRecordsMax) {
      return Error{
          fmt::format("{}: more than {} ODOM and FLASER lines; cut the log", path, kLogRecordsMax)};
    }
  }
  if (reader->is_cut()) {
    log.cut = fmt::format("{}: the gzip archive ends too early; {} lines were read", path,
                          reader->line_number());
  }
  if (log.records.empty()) {
    if (!log.cut.empty()) return Error{log.cut + ", none of them ODOM or FLASER"};
    std::string sentence =
        fmt::format("{}: no ODOM and no FLASER line in {} lines; is it a CARMEN log?", path,
                    reader->line_number());
    if (log.skipped != 0) sentence += " The first line that is none: " + log.first_skipped;
    return Error{std::move(sentence)};
  }
  pace_log(log);
  if (log.skipped != 0) {
    if (!log.pacing_note.empty()) log.pacing_note += "; ";
    log.pacing_note +=
        fmt::format("skipped {} that cannot be read",
                    log.skipped == 1 ? "a line" : fmt::format("{} lines", log.skipped));
  }
  return log;
}

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

// Records without a stamp, and those that step back a little, as merged logs have them, are due at
// once. A stamp far from the one before is a slip of the recorder, the end of a gap or another
// clock: it is due at once, and followed from there on.
void pace_by_stamps(RobotLog& log) {
  double due_s = 0.0;
  std::optional<double> clock_s;
  for (LogRecord& record : log.records) {
    if (record.stamp_s != 0.0) {
      const double step_s = record.stamp_s - clock_s.value_or(record.stamp_s);
      const bool near = std::abs(step_s) <= kLongestPause_s;
      if (near) due_s += std::max(step_s, 0.0);
      if (!near || step_s >= 0.0) clock_s = record.stamp_s;
    }
    record.due_s = due_s;
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
