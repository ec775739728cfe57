#include "tools/demo/keys.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace gimnet::demo {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

TEST(KeyParser, KnowsLettersInEitherCase) {
  KeyParser parser;
  EXPECT_THAT(parser.take("wAsD q", 0), ElementsAre(Key::kForward, Key::kLeft, Key::kBack,
                                                    Key::kRight, Key::kStop, Key::kQuit));
}

TEST(KeyParser, KnowsArrowsInBothModes) {
  KeyParser parser;
  EXPECT_THAT(parser.take("\x1b[A\x1bOB\x1b[D\x1b[1;2C", 0),
              ElementsAre(Key::kForward, Key::kBack, Key::kLeft, Key::kRight));
}

TEST(KeyParser, CtrlCAndTheEndOfInputQuit) {
  KeyParser parser;
  EXPECT_THAT(parser.take("\x03\x04", 0), ElementsAre(Key::kQuit, Key::kQuit));
}

TEST(KeyParser, ASequenceMayComeInPieces) {
  KeyParser parser;
  EXPECT_THAT(parser.take("\x1b", 0), IsEmpty());
  EXPECT_THAT(parser.take("[", 0), IsEmpty());
  EXPECT_THAT(parser.take("Aw", 0), ElementsAre(Key::kForward, Key::kForward));
}

TEST(KeyParser, UnknownSequencesAreSkippedWhole) {
  KeyParser parser;
  EXPECT_THAT(parser.take("\x1b[15~\x1b[200~w\x1bOP\x1b[[A\x1b[[C", 0), ElementsAre(Key::kForward));
}

TEST(KeyParser, EscSwallowsNoOtherKey) {
  KeyParser parser;
  EXPECT_THAT(parser.take("\x1bq\x1b\x03\x1b \x1b\x1bw", 0),
              ElementsAre(Key::kQuit, Key::kQuit, Key::kStop, Key::kForward));
  // In pieces, as it is typed.
  EXPECT_THAT(parser.take("\x1b", 0), IsEmpty());
  EXPECT_THAT(parser.take(" ", 1), ElementsAre(Key::kStop));
  EXPECT_THAT(parser.take("\x1b", 2), IsEmpty());
  EXPECT_THAT(parser.take("\x1b[A", 3), ElementsAre(Key::kForward));
}

TEST(KeyParser, AControlCharacterIsAKeyWithinASequenceToo) {
  KeyParser parser;
  EXPECT_THAT(parser.take("\x1b[1\x03\x1bO\x03q", 0),
              ElementsAre(Key::kQuit, Key::kQuit, Key::kQuit));
}

TEST(KeyParser, WhatBecomesNoSequenceInTimeIsForgotten) {
  constexpr std::int64_t kPatience_ns = KeyParser::kSequencePatience_ns;
  for (const char* begun : {"\x1b", "\x1b[", "\x1bO", "\x1b[1;"}) {
    KeyParser parser;
    EXPECT_THAT(parser.take(begun, 1000), IsEmpty());
    EXPECT_THAT(parser.take("", 1000 + kPatience_ns), IsEmpty());
    EXPECT_THAT(parser.take("O", 1001 + kPatience_ns), IsEmpty());
    EXPECT_THAT(parser.take("q ", 1002 + kPatience_ns), ElementsAre(Key::kQuit, Key::kStop))
        << begun;
  }
  KeyParser parser;
  EXPECT_THAT(parser.take("\x1b[", 1000), IsEmpty());
  EXPECT_THAT(parser.take("", 999 + kPatience_ns), IsEmpty());
  EXPECT_THAT(parser.take("A", 1000 + kPatience_ns), ElementsAre(Key::kForward));
}

TEST(KeyParser, ASequenceWithoutEndIsGivenUp) {
  KeyParser parser;
  EXPECT_THAT(parser.take("\x1b[" + std::string(40, '1'), 0), IsEmpty());
  EXPECT_THAT(parser.take("w", 0), ElementsAre(Key::kForward));
}

TEST(KeyParser, OtherBytesMeanNothing) {
  KeyParser parser;
  EXPECT_THAT(parser.take(std::string("\0\xff\x80xyz", 6), 0), IsEmpty());
}

}  // namespace

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
