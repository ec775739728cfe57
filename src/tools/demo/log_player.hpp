#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "tools/demo/carmen_log.hpp"
#include "tools/demo/robot.hpp"

namespace gimnet::demo {

/// Slowest and fastest playback, as a multiple of the recorded speed.
inline constexpr double kPlaySpeedMin = 0.1;
inline constexpr double kPlaySpeedMax = 100.0;

/// Plays a recorded run. Commands set the speed and hold it; the robot itself cannot be driven any
/// more.
class LogPlayer final : public RobotSource {
 public:
  /// The beginning of a playback. `speed` is within kPlaySpeedMin .. kPlaySpeedMax.
  struct Start {
    std::string source;
    double speed = 1.0;
    std::int64_t start_ns = 0;
  };

  LogPlayer(RobotLog log, Start start);

  void handle(const DriveCommand& command, std::int64_t now_ns) override;
  void advance(std::int64_t now_ns, const Output& output) override;
  [[nodiscard]] std::int64_t next_due_ns() const override;
  [[nodiscard]] RobotInfo info() const override;

 private:
  void let_time_pass(std::int64_t now_ns);
  void say(const LogRecord& record, const Output& output);
  [[nodiscard]] Twist twist_at(const LogRecord& record);

  RobotLog log_;
  std::string source_;
  double speed_;
  bool paused_ = false;
  std::int64_t clock_ns_;
  double played_s_ = 0.0;
  std::size_t next_ = 0;
  std::size_t twist_from_ = 0;
  Stamp answers_;
};

}  // namespace gimnet::demo
