#include "hub/config/value.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>

namespace gimnet::hub {
namespace {

using ::testing::IsEmpty;
using Kind = ConfigValue::Kind;

constexpr std::array<std::string_view, 2> kWords{"fast", "slow"};

Given given(Kind kind, const std::string& text) {
  return {"t.speed", {kind, text, {}, "f:1:9"}, "f:1:1", "t.speed", "f:1"};
}

TEST(Value, IsANumberInItsRange) {
  Faults faults;
  EXPECT_EQ(number_in(given(Kind::integer, "3"), 3, 5, faults), 3u);
  EXPECT_EQ(number_in(given(Kind::words, "5"), 3, 5, faults), 5u);
  EXPECT_THAT(faults, IsEmpty());
  for (const char* text : {"2", "6", "-3", "+3", "", "3x"})
    EXPECT_FALSE(number_in(given(Kind::integer, text), 3, 5, faults)) << text;
  EXPECT_EQ(faults[0].line(), "f:1:9: t.speed cannot be '2': give a whole number from 3 to 5");
  EXPECT_FALSE(number_in(given(Kind::text, "4"), 3, 5, faults));
  EXPECT_EQ(faults.back().line(), "f:1:9: t.speed is a whole number, not a text: write speed = 4");
}

TEST(Value, TheNearestNumberIsWithinTheRange) {
  EXPECT_EQ(nearest_number(given(Kind::text, "1").value, 3, 5, 4), 3u);
  EXPECT_EQ(nearest_number(given(Kind::fraction, "1e9").value, 3, 5, 4), 5u);
  EXPECT_EQ(nearest_number(given(Kind::fraction, "4.6").value, 3, 5, 4), 5u);
  EXPECT_EQ(nearest_number(given(Kind::text, "many").value, 3, 5, 4), 4u);
  EXPECT_EQ(nearest_number(given(Kind::boolean, "true").value, 3, 5, 4), 4u);
}

TEST(Value, IsOneOfAFewWords) {
  Faults faults;
  EXPECT_TRUE(one_of(given(Kind::text, "slow"), kWords, "fast or slow", faults));
  EXPECT_FALSE(one_of(given(Kind::text, "slwo"), kWords, "fast or slow", faults));
  EXPECT_EQ(faults[0].line(), "f:1:9: t.speed cannot be 'slwo': fast or slow; did you mean slow?");
}

TEST(Value, IsTrueOrFalse) {
  Faults faults;
  EXPECT_EQ(true_or_false(given(Kind::boolean, "true"), faults), true);
  EXPECT_EQ(true_or_false(given(Kind::words, "false"), faults), false);
  EXPECT_THAT(faults, IsEmpty());
  EXPECT_FALSE(true_or_false(given(Kind::words, "yes"), faults));
  EXPECT_EQ(faults[0].line(), "f:1:9: t.speed cannot be 'yes': write true or false");
  EXPECT_FALSE(true_or_false(given(Kind::integer, "1"), faults));
  EXPECT_EQ(faults[1].line(),
            "f:1:9: t.speed is true or false, not a whole number: write speed = true");
}

}  // namespace
}  // namespace gimnet::hub
