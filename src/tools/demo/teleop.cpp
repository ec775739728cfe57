#include "tools/demo/teleop.hpp"

namespace gimnet::demo {

void Teleop::press(Key key, std::int64_t now_ns) {
  switch (key) {
    case Key::kForward:
    case Key::kBack:
      linear_ = key == Key::kForward ? kLinear_mps : -kLinear_mps / 2.0;
      linear_until_ns_ = now_ns + kHoldLinear_ns;
      break;
    case Key::kLeft:
    case Key::kRight:
      angular_ = key == Key::kLeft ? kAngular_radps : -kAngular_radps;
      angular_until_ns_ = now_ns + kHoldAngular_ns;
      break;
    case Key::kStop:
      linear_until_ns_ = angular_until_ns_ = now_ns;
      break;
    default:
      break;
  }
}

Twist Teleop::twist(std::int64_t now_ns) const {
  return {now_ns < linear_until_ns_ ? linear_ : 0.0, now_ns < angular_until_ns_ ? angular_ : 0.0};
}

}  // namespace gimnet::demo
