#pragma once

#include <cstdint>
#include <functional>

#include "tools/demo/messages.hpp"

namespace gimnet::demo {

/// Where a robot's data come from: a simulation, or a log. A source has no clock of its own: it is
/// told the time, in ns since 1970, and says when it wants to be told again. Thread safety: one
/// thread.
class RobotSource {
 public:
  /// Takes what the robot says. Numbers and stamps are filled in.
  struct Output {
    std::function<void(const Odometry&)> on_odometry;
    std::function<void(const Scan&)> on_scan;
  };

  virtual ~RobotSource() = default;

  /// Takes a command; from then on it is the one that moves the robot.
  virtual void handle(const DriveCommand& command, std::int64_t now_ns) = 0;

  /// Says everything that is due at `now_ns`. Times do not go back.
  virtual void advance(std::int64_t now_ns, const Output& output) = 0;

  /// When something is due next.
  [[nodiscard]] virtual std::int64_t next_due_ns() const = 0;

  /// Source, note, map, progress; without number, stamp and totals.
  [[nodiscard]] virtual RobotInfo info() const = 0;
};

}  // namespace gimnet::demo
