#pragma once

#include <cstdint>

#include "tools/demo/geometry.hpp"
#include "tools/demo/keys.hpp"

namespace gimnet::demo {

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

  /// What is wanted at that time.
  [[nodiscard]] Twist twist(std::int64_t now_ns) const;

 private:
  double linear_ = 0.0;
  double angular_ = 0.0;
  std::int64_t linear_until_ns_ = 0;
  std::int64_t angular_until_ns_ = 0;
};

}  // namespace gimnet::demo
