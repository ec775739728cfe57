#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "tools/demo/geometry.hpp"

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

}  // namespace gimnet::demo
