#include "hub/control/state/session_token.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace gimnet::hub {
namespace {

using ::testing::ElementsAre;

std::vector<unsigned> numbers(const MacText& text) {
  std::vector<unsigned> found;
  for (const std::byte each : text.bytes()) found.push_back(std::to_integer<unsigned>(each));
  return found;
}

TEST(MacText, TextsStandBehindTheirLengthsAndNumbersAreLittleEndian) {
  MacText text("ab");
  text.add_number(std::uint16_t{0x0102}).add("c").add_bytes(std::as_bytes(std::span{"d", 1}));
  EXPECT_THAT(numbers(text), ElementsAre(2, 0, 0, 0, 'a', 'b', 2, 1, 1, 0, 0, 0, 'c', 'd'));
}

TEST(MacText, TheSameLettersDividedInAnotherWayAreAnotherText) {
  MacText one("");
  one.add("robot").add("1");
  MacText other("");
  other.add("robo").add("t1");
  EXPECT_NE(numbers(one), numbers(other));
}

}  // namespace
}  // namespace gimnet::hub
