#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "tools/demo/geometry.hpp"

namespace gimnet::demo {

/// The keys that the demo understands.
enum class Key : std::uint8_t {
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

/// Turns the bytes of a terminal into keys: letters in either case, arrows, Ctrl-C and Ctrl-L. A
/// sequence that was cut waits for its rest; unknown ones are skipped whole. Esc alone means
/// nothing, and swallows nothing but what makes a sequence of it within `kSequencePatience_ns`.
/// Thread safety: one thread.
class KeyParser {
 public:
  /// A terminal writes a sequence at once, and a network delivers it in pieces at worst; nobody
  /// types that fast.
  static constexpr std::int64_t kSequencePatience_ns = 100'000'000;

  /// Takes the bytes since the last call. Call it without bytes too: so it learns that no more of a
  /// sequence comes. Times are of any clock that does not go back.
  [[nodiscard]] std::vector<Key> take(std::string_view bytes, std::int64_t now_ns);

 private:
  std::string pending_;
  std::int64_t pending_since_ns_ = 0;
};

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
  void press(Key key, std::int64_t now_ns);

  /// The wanted speed at that time.
  [[nodiscard]] Twist twist(std::int64_t now_ns) const;

 private:
  double linear_ = 0.0;
  double angular_ = 0.0;
  std::int64_t linear_until_ns_ = 0;
  std::int64_t angular_until_ns_ = 0;
};

}  // namespace gimnet::demo
