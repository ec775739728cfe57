#include "tools/demo/keys.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace gimnet::demo {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

TEST(KeyParser, KnowsLettersInEitherCase) {
  KeyParser parser;
  EXPECT_THAT(parser.take("wAsD q"),
              ElementsAre(Key::kForward, Key::kLeft, Key::kBack, Key::kRight, Key::kStop, Key::kQuit));
}

TEST(KeyParser, KnowsArrowsInBothModes) {
  KeyParser parser;
  EXPECT_THAT(parser.take("\x1b[A\x1bOB\x1b[D\x1b[1;2C"),
              ElementsAre(Key::kForward, Key::kBack, Key::kLeft, Key::kRight));
}

TEST(KeyParser, CtrlCAndTheEndOfInputQuit) {
  KeyParser parser;
  EXPECT_THAT(parser.take("\x03\x04"), ElementsAre(Key::kQuit, Key::kQuit));
}

TEST(KeyParser, ASequenceMayComeInPieces) {
  KeyParser parser;
  EXPECT_THAT(parser.take("\x1b"), IsEmpty());
  EXPECT_THAT(parser.take("["), IsEmpty());
  EXPECT_THAT(parser.take("Aw"), ElementsAre(Key::kForward, Key::kForward));
}

TEST(KeyParser, UnknownSequencesAreSkippedWhole) {
  KeyParser parser;
  EXPECT_THAT(parser.take("\x1b[15~\x1b[200~w\x1bw"), ElementsAre(Key::kForward));
}

TEST(KeyParser, ASequenceWithoutEndIsGivenUp) {
  KeyParser parser;
  EXPECT_THAT(parser.take("\x1b[" + std::string(40, '1')), IsEmpty());
  EXPECT_THAT(parser.take("w"), ElementsAre(Key::kForward));
}

TEST(KeyParser, OtherBytesMeanNothing) {
  KeyParser parser;
  EXPECT_THAT(parser.take(std::string("\0\xff\x80xyz", 6)), IsEmpty());
}

}  // namespace
}  // namespace gimnet::demo
