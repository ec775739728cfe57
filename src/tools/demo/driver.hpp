#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "tools/demo/geometry.hpp"
#include "tools/demo/messages.hpp"
#include "tools/demo/monitor.hpp"

namespace gimnet::demo {

/// The keys that the demo understands.
enum class Keystroke : std::uint8_t {
  kForward,
  kBack,
  kLeft,
  kRight,
  kStop,
  kFaster,
  kSlower,
  kZoomIn,
  kZoomOut,
  kFit,
  kFollow,
  kTrail,
  kAutopilot,
  kHelp,
  kRedraw,
  kQuit,
};

/// The keys in the bytes of a terminal: letters in either case, arrows, Ctrl-C and Ctrl-L.
/// Sequences that mean nothing here are skipped whole, and so is Esc alone. Thread safety: pure
/// function.
[[nodiscard]] std::vector<Keystroke> keys_in(std::string_view bytes);

/// Turns keys into a wanted speed. A terminal tells that a key goes down and repeats, never that it
/// goes up: a key holds for a while and then lets go, long enough to bridge the pause before the
/// first repeat. Two axes are held apart, so that W and A together drive a curve. Thread safety:
/// one thread.
class Teleop {
 public:
  static constexpr double kLinear_mps = 0.8;
  static constexpr double kAngular_radps = 1.4;
  static constexpr std::int64_t kHoldLinear_ns = 650'000'000;
  static constexpr std::int64_t kHoldAngular_ns = 300'000'000;

  /// Takes a key; others than W A S D and space are not its business.
  void press(Keystroke key, std::int64_t now_ns);

  /// The wanted speed at that time.
  [[nodiscard]] Twist twist(std::int64_t now_ns) const;

 private:
  double linear_ = 0.0;
  double angular_ = 0.0;
  std::int64_t linear_until_ns_ = 0;
  std::int64_t angular_until_ns_ = 0;
};

/// A driver that visits corners in turn, for ever: turns towards the next one, then drives, slower
/// where it must turn. It steers by what it hears from the robot, so that the loop is closed over
/// the network. Thread safety: one thread.
class Course {
 public:
  explicit Course(std::vector<Point> corners) : corners_(std::move(corners)) {}

  /// The speed at that pose. Without corners: none.
  [[nodiscard]] Twist steer(const Pose& pose);

  /// Corners that were reached.
  [[nodiscard]] std::size_t reached() const { return reached_; }

 private:
  std::vector<Point> corners_;
  std::size_t next_ = 0;
  std::size_t reached_ = 0;
};

/// Decides what the robot is told, and when: a simulated one 20 times a second, by the keyboard or
/// by the course; a log only when its speed or its holding changes. Thread safety: one thread.
class Driver {
 public:
  static constexpr std::int64_t kPeriod_ns = 50'000'000;

  explicit Driver(bool autopilot) : autopilot_(autopilot) {}

  /// Takes a key of driving or playing; others are not its business.
  void press(Keystroke key, const Monitor& monitor, std::int64_t now_ns);

  /// From now on only one thing is said: finish.
  void finish() { finish_ = true; }

  /// The command that is due, if one is.
  [[nodiscard]] std::optional<DriveCommand> next(const Monitor& monitor, std::int64_t now_ns);

  [[nodiscard]] bool autopilot() const { return autopilot_; }
  /// Corners of the course that were reached.
  [[nodiscard]] std::size_t corners_reached() const { return course_ ? course_->reached() : 0; }
  /// Commands that were given out.
  [[nodiscard]] std::uint64_t commands() const { return number_; }

 private:
  void change_speed(double speed);
  [[nodiscard]] Twist wanted(const Monitor& monitor, std::int64_t now_ns);

  bool autopilot_;
  bool finish_ = false;
  bool finish_said_ = false;
  bool changed_ = false;
  bool paused_ = false;
  std::optional<double> speed_;
  std::optional<Course> course_;
  Teleop teleop_;
  std::int64_t next_ns_ = 0;
  std::uint64_t number_ = 0;
};

}  // namespace gimnet::demo
