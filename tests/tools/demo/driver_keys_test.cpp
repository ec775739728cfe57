#include "tools/demo/driver.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace gimnet::demo {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

TEST(KeysIn, KnowsLettersInEitherCase) {
  EXPECT_THAT(keys_in("wAsD q"),
              ElementsAre(Keystroke::kForward, Keystroke::kLeft, Keystroke::kBack,
                          Keystroke::kRight, Keystroke::kStop, Keystroke::kQuit));
}

TEST(KeysIn, KnowsArrowsInBothModes) {
  EXPECT_THAT(
      keys_in("\x1b[A\x1bOB\x1b[D\x1b[1;2C"),
      ElementsAre(Keystroke::kForward, Keystroke::kBack, Keystroke::kLeft, Keystroke::kRight));
}

TEST(KeysIn, CtrlCAndTheEndOfInputQuit) {
  EXPECT_THAT(keys_in("\x03\x04"), ElementsAre(Keystroke::kQuit, Keystroke::kQuit));
}

TEST(KeysIn, UnknownSequencesAreSkippedWhole) {
  EXPECT_THAT(keys_in("\x1b[15~\x1b[200~w\x1bOP\x1b[[A\x1b[[C"), ElementsAre(Keystroke::kForward));
  for (const char* begun : {"\x1b", "\x1b[", "\x1bO", "\x1b[1;"})
    EXPECT_THAT(keys_in(begun), IsEmpty()) << begun;
}

TEST(KeysIn, EscSwallowsNoOtherKey) {
  EXPECT_THAT(
      keys_in("\x1bq\x1b\x03\x1b \x1b\x1bw"),
      ElementsAre(Keystroke::kQuit, Keystroke::kQuit, Keystroke::kStop, Keystroke::kForward));
}

TEST(KeysIn, AControlCharacterIsAKeyWithinASequenceToo) {
  EXPECT_THAT(keys_in("\x1b[1\x03\x1bO\x03q"),
              ElementsAre(Keystroke::kQuit, Keystroke::kQuit, Keystroke::kQuit));
}

TEST(KeysIn, OtherBytesMeanNothing) {
  EXPECT_THAT(keys_in(std::string("\0\xff\x80xyz", 6)), IsEmpty());
}

}  // namespace

namespace {

TEST(Teleop, StandsStillAtFirst) {
  EXPECT_EQ(Teleop().twist(0).linear_mps, 0.0);
  EXPECT_EQ(Teleop().twist(0).angular_radps, 0.0);
}

TEST(Teleop, AKeyHoldsForAWhileAndLetsGo) {
  Teleop teleop;
  teleop.press(Keystroke::kForward, 1000);
  EXPECT_EQ(teleop.twist(1000).linear_mps, Teleop::kLinear_mps);
  EXPECT_EQ(teleop.twist(1000 + Teleop::kHoldLinear_ns - 1).linear_mps, Teleop::kLinear_mps);
  EXPECT_EQ(teleop.twist(1000 + Teleop::kHoldLinear_ns).linear_mps, 0.0);
}

TEST(Teleop, TwoAxesMakeACurve) {
  Teleop teleop;
  teleop.press(Keystroke::kBack, 0);
  teleop.press(Keystroke::kRight, 1);
  EXPECT_LT(teleop.twist(2).linear_mps, 0.0);
  EXPECT_EQ(teleop.twist(2).angular_radps, -Teleop::kAngular_radps);
}

TEST(Teleop, SpaceStopsAtOnce) {
  Teleop teleop;
  teleop.press(Keystroke::kForward, 0);
  teleop.press(Keystroke::kLeft, 0);
  teleop.press(Keystroke::kStop, 5);
  EXPECT_EQ(teleop.twist(5).linear_mps, 0.0);
  EXPECT_EQ(teleop.twist(5).angular_radps, 0.0);
}

TEST(Teleop, OtherKeysDoNotDrive) {
  Teleop teleop;
  teleop.press(Keystroke::kZoomIn, 0);
  EXPECT_EQ(teleop.twist(0).linear_mps, 0.0);
}

}  // namespace

}  // namespace gimnet::demo
