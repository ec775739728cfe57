#include "proto/control/pattern.hpp"

#include <gtest/gtest.h>

namespace gimnet::proto {
namespace {

bool fits(const char* pattern, const char* name) {
  const auto parsed = Pattern::parse(pattern);
  return parsed && parsed->matches(name);
}

TEST(Pattern, AStarIsOnePartAndTwoAreAnyNumber) {
  EXPECT_TRUE(fits("hall/*", "hall/robot"));
  EXPECT_FALSE(fits("hall/*", "hall"));
  EXPECT_FALSE(fits("hall/*", "hall/robot/odom"));
  EXPECT_TRUE(fits("hall/**", "hall"));
  EXPECT_TRUE(fits("hall/**", "hall/robot/odom"));
  EXPECT_TRUE(fits("**/odom", "odom"));
  EXPECT_TRUE(fits("**/odom", "hall/robot/odom"));
  EXPECT_TRUE(fits("hall/**/odom", "hall/odom"));
  EXPECT_FALSE(fits("hall/**/odom", "hall/robot/pose"));
  EXPECT_TRUE(fits("**/**/*", "robot"));
}

TEST(Pattern, WithoutAStarFitsOneName) {
  EXPECT_TRUE(Pattern::parse("hall/robot")->is_name());
  EXPECT_TRUE(fits("hall/robot", "hall/robot"));
  EXPECT_FALSE(fits("hall/robot", "hall/robot-2"));
  EXPECT_FALSE(Pattern::parse("hall/*")->is_name());
}

TEST(Pattern, KnowsHowEveryNameThatFitsBegins) {
  EXPECT_EQ(Pattern::parse("hall/*/odom")->beginning(), "hall");
  EXPECT_EQ(Pattern::parse("hall/robot/**")->beginning(), "hall/robot");
  EXPECT_EQ(Pattern::parse("**/odom")->beginning(), "");
  EXPECT_EQ(Pattern::parse("hall/robot")->beginning(), "hall/robot");
  EXPECT_FALSE(fits("hall/*", "hall-2/robot"));
}

TEST(Pattern, OnlyWholePartsAreStars) {
  EXPECT_FALSE(Pattern::parse("hall*/robot"));
  EXPECT_FALSE(Pattern::parse("hall/***"));
  EXPECT_FALSE(Pattern::parse("hall//robot"));
  EXPECT_FALSE(Pattern::parse(""));
  EXPECT_FALSE(Pattern::parse("/*"));
}

/// A pattern of nothing but stars would keep a matcher that tries all ways busy for ever.
TEST(Pattern, TheWorstOneIsComparedWithTheWorstNameAtOnce) {
  std::string pattern = "**/a";
  for (int i = 0; i < 7; ++i) pattern += "/**/a";
  std::string name = "a";
  for (int i = 0; i < 14; ++i) name += "/a";
  const auto parsed = Pattern::parse(pattern);
  ASSERT_TRUE(parsed);
  EXPECT_TRUE(parsed->matches(name));
  EXPECT_FALSE(parsed->matches(name + "/b"));
}

TEST(Pattern, HasAtMost16PartsAnd255Bytes) {
  std::string longest = "**";
  for (int i = 0; i < 15; ++i) longest += "/**";
  EXPECT_TRUE(Pattern::parse(longest));
  EXPECT_FALSE(Pattern::parse(longest + "/**"));
  EXPECT_TRUE(Pattern::parse(std::string(253, 'a') + "/*"));
  EXPECT_FALSE(Pattern::parse(std::string(254, 'a') + "/*"));
}

}  // namespace
}  // namespace gimnet::proto
