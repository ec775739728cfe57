#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include "base/result.hpp"
#include "tools/demo/messages.hpp"
#include "tools/demo/node_port.hpp"

namespace gimnet::demo {

/// The origin of a robot's data: a simulation, or a log. A source has no clock of its own: it is
/// told the time, in ns since 1970, and says when it wants to be told again. Thread safety: one
/// thread.
class RobotSource {
 public:
  /// Takes the robot's messages, without number and stamp.
  struct Output {
    std::function<void(Odometry)> on_odometry;
    std::function<void(Scan)> on_scan;
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

/// The robot's process: publishes what a source says and passes commands to it. It begins when
/// somebody listens, so that nothing is said to nobody; from then on it goes on until told to stop.
/// Thread safety: one thread. Ownership: of the source; not of the port.
class Robot {
 public:
  static constexpr std::int64_t kInfoPeriod_ns = 500'000'000;
  /// Longest wait in one step, so that signals and a full stop are seen soon.
  static constexpr std::int64_t kWait_ns = 50'000'000;

  /// Makes the source when the robot begins, at that time.
  using SourceMaker = std::function<std::unique_ptr<RobotSource>(std::int64_t now_ns)>;

  Robot(NodePort& port, SourceMaker make_source)
      : port_(port), make_source_(std::move(make_source)) {}

  /// Waits for a message or for what is due next, and sees to it. Errors: the connection ended for
  /// good.
  [[nodiscard]] std::optional<Error> step();

  /// Was told by a driver to say no more, and has said so.
  [[nodiscard]] bool finished() const { return finished_; }

 private:
  void handle(const NodePort::Event& event, std::int64_t now_ns);
  void publish(Service service, const Bytes& bytes);
  void publish_info(std::int64_t now_ns);
  [[nodiscard]] std::int64_t wait_ns(std::int64_t now_ns) const;

  NodePort& port_;
  SourceMaker make_source_;
  std::unique_ptr<RobotSource> source_;
  std::optional<Error> error_;
  std::int64_t next_info_ns_ = 0;
  std::uint64_t info_total_ = 0;
  std::uint64_t odometry_total_ = 0;
  std::uint64_t scan_total_ = 0;
  std::uint64_t drive_total_ = 0;
  bool said_ended_ = false;
  bool finish_ = false;
  bool finished_ = false;
};

}  // namespace gimnet::demo
