#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "tools/demo/messages.hpp"
#include "tools/demo/node_port.hpp"
#include "tools/demo/occupancy_map.hpp"
#include "tools/demo/world_map.hpp"

namespace gimnet::demo {

/// The latest durations, for percentiles and a little curve. Thread safety: one thread. Limits:
/// keeps `capacity`.
class SampleWindow {
 public:
  /// REQUIRES: capacity > 0.
  explicit SampleWindow(std::size_t capacity) : capacity_(capacity) {}

  void add(std::int64_t duration_ns);

  /// The smallest duration that `percent` of all are not above (nearest rank); nothing if there are
  /// none.
  [[nodiscard]] std::optional<std::int64_t> percentile_ns(double percent) const;

  /// The latest `count` durations, oldest first; fewer if there are fewer.
  [[nodiscard]] std::vector<std::int64_t> latest(std::size_t count) const;

 private:
  std::size_t capacity_;
  std::vector<std::int64_t> samples_;
  std::size_t oldest_ = 0;
};

/// Counts events within the last seconds. Thread safety: one thread.
class RateMeter {
 public:
  static constexpr std::int64_t kWindow_ns = 3'000'000'000;

  void add(std::int64_t now_ns);
  /// Events per second.
  [[nodiscard]] double rate_hz(std::int64_t now_ns) const;

 private:
  std::vector<std::int64_t> times_ns_;
  std::optional<std::int64_t> first_ns_;
};

/// The record of one stream of numbered messages.
struct StreamRecord {
  RateMeter rate;
  /// Ages of messages on arrival; of commands: until the first odometry that follows them.
  SampleWindow age{2000};
  std::uint64_t received = 0;
  /// Numbers that were skipped.
  std::uint64_t missed = 0;
  /// Of these, those whose loss is as it should be.
  std::uint64_t excused = 0;
  /// Messages that came twice or out of order.
  std::uint64_t disordered = 0;
  std::uint64_t last_number = 0;
  std::int64_t last_made_ns = 0;
  /// The sender began before: the first number may be any.
  bool joined_late = false;

  /// Is the loss of a message that was made at that time as it should be? Empty: of none.
  using Excuse = std::function<bool(std::int64_t made_ns)>;
  void take(const Stamp& stamp, std::int64_t now_ns, const Excuse& excuse = {});

 private:
  void miss(std::uint64_t count, std::int64_t until_ns, const Excuse& excuse);
};

/// Everything that the viewer has heard, ready to be shown. Times are ns since 1970. Thread safety:
/// one thread. Limits: a trail of `kTrailPointsMax` points, thinned out when it is full.
class Monitor {
 public:
  static constexpr std::size_t kTrailPointsMax = 20'000;
  static constexpr double kTrailStep_m = 0.04;

  /// `joined_late`: the robot may have begun before, so messages before the first are not missed.
  explicit Monitor(std::int64_t start_ns, bool joined_late = false) : start_ns_(start_ns) {
    odometry_stream_.joined_late = scan_stream_.joined_late = joined_late;
  }

  /// Losses for which it answers true are as they should be.
  void excuse_by(StreamRecord::Excuse excuse) { excuse_ = std::move(excuse); }

  void take(const Odometry& message, std::int64_t now_ns);
  void take(const Scan& message, std::int64_t now_ns);
  void take(const RobotInfo& message, std::int64_t now_ns);
  void take(const HubCounters& counters) { hub_ = counters; }
  /// A command was sent.
  void sent(const DriveCommand& message, std::int64_t now_ns);
  /// A message that could not be read.
  void garbled() { ++garbled_; }

  [[nodiscard]] std::int64_t start_ns() const { return start_ns_; }
  [[nodiscard]] const std::optional<Odometry>& odometry() const { return odometry_; }
  [[nodiscard]] const std::optional<Scan>& scan() const { return scan_; }
  /// The robot's place by its odometry; by its last scan, if it has none: a log may hold only one
  /// of them.
  [[nodiscard]] std::optional<Pose> pose() const;
  [[nodiscard]] const std::optional<RobotInfo>& info() const { return info_; }
  [[nodiscard]] const std::optional<HubCounters>& hub() const { return hub_; }
  /// The hall, where the robot sent one.
  [[nodiscard]] const std::optional<WorldMap>& plan() const { return plan_; }
  [[nodiscard]] const OccupancyMap& seen() const { return seen_; }
  [[nodiscard]] const std::vector<Point>& trail() const { return trail_; }

  [[nodiscard]] const StreamRecord& odometry_stream() const { return odometry_stream_; }
  [[nodiscard]] const StreamRecord& scan_stream() const { return scan_stream_; }
  [[nodiscard]] const StreamRecord& drive_stream() const { return drive_stream_; }
  [[nodiscard]] std::uint64_t garbled_messages() const { return garbled_; }
  /// Metres driven.
  [[nodiscard]] double way_m() const { return way_m_; }

 private:
  void extend_trail(const Pose& pose);

  std::int64_t start_ns_;
  StreamRecord::Excuse excuse_;
  std::optional<Odometry> odometry_;
  std::optional<Scan> scan_;
  std::optional<RobotInfo> info_;
  std::optional<HubCounters> hub_;
  std::optional<WorldMap> plan_;
  OccupancyMap seen_;
  std::vector<Point> trail_;
  StreamRecord odometry_stream_;
  StreamRecord scan_stream_;
  StreamRecord drive_stream_;
  std::uint64_t answered_ = 0;
  std::uint64_t garbled_ = 0;
  double way_m_ = 0.0;
};

}  // namespace gimnet::demo
