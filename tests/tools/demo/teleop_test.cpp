#include "tools/demo/teleop.hpp"

#include <gtest/gtest.h>

namespace gimnet::demo {
namespace {

TEST(Teleop, StandsStillAtFirst) {
  EXPECT_EQ(Teleop().twist(0).linear_mps, 0.0);
  EXPECT_EQ(Teleop().twist(0).angular_radps, 0.0);
}

TEST(Teleop, AKeyHoldsForAWhileAndLetsGo) {
  Teleop teleop;
  teleop.press(Key::kForward, 1000);
  EXPECT_EQ(teleop.twist(1000).linear_mps, Teleop::kLinear_mps);
  EXPECT_EQ(teleop.twist(1000 + Teleop::kHoldLinear_ns - 1).linear_mps, Teleop::kLinear_mps);
  EXPECT_EQ(teleop.twist(1000 + Teleop::kHoldLinear_ns).linear_mps, 0.0);
}

TEST(Teleop, TwoAxesMakeACurve) {
  Teleop teleop;
  teleop.press(Key::kBack, 0);
  teleop.press(Key::kRight, 1);
  EXPECT_LT(teleop.twist(2).linear_mps, 0.0);
  EXPECT_EQ(teleop.twist(2).angular_radps, -Teleop::kAngular_radps);
}

TEST(Teleop, SpaceStopsAtOnce) {
  Teleop teleop;
  teleop.press(Key::kForward, 0);
  teleop.press(Key::kLeft, 0);
  teleop.press(Key::kStop, 5);
  EXPECT_EQ(teleop.twist(5).linear_mps, 0.0);
  EXPECT_EQ(teleop.twist(5).angular_radps, 0.0);
}

TEST(Teleop, OtherKeysDoNotDrive) {
  Teleop teleop;
  teleop.press(Key::kZoomIn, 0);
  EXPECT_EQ(teleop.twist(0).linear_mps, 0.0);
}

}  // namespace
}  // namespace gimnet::demo
