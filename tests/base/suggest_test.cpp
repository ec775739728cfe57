#include "base/suggest.hpp"

#include <gtest/gtest.h>

#include <array>

namespace gimnet {
namespace {

TEST(EditDistance, CountsLetters) {
  EXPECT_EQ(edit_distance("", ""), 0u);
  EXPECT_EQ(edit_distance("", "abc"), 3u);
  EXPECT_EQ(edit_distance("abc", ""), 3u);
  EXPECT_EQ(edit_distance("shards", "shards"), 0u);
  EXPECT_EQ(edit_distance("shard", "shards"), 1u);
  EXPECT_EQ(edit_distance("kitten", "sitting"), 3u);
}

TEST(EditDistance, CountsASwapOfNeighboursOnce) {
  EXPECT_EQ(edit_distance("lsiten", "listen"), 1u);
}

TEST(DidYouMean, NamesTheNearest) {
  constexpr std::array<std::string_view, 3> kWords{"--listen", "--limit", "--shards"};
  EXPECT_EQ(did_you_mean("--lisen", kWords), "; did you mean --listen?");
  EXPECT_EQ(did_you_mean("--shrads", kWords), "; did you mean --shards?");
}

TEST(DidYouMean, CapitalsAreNoDifference) {
  constexpr std::array<std::string_view, 3> kWords{"hub_id", "hub_name", "Robot"};
  EXPECT_EQ(did_you_mean("HUB_ID", kWords), "; did you mean hub_id?");
  EXPECT_EQ(did_you_mean("HBU_NAME", kWords), "; did you mean hub_name?");
  EXPECT_EQ(did_you_mean("robot", kWords), "; did you mean Robot?");
  EXPECT_EQ(edit_distance("HUB", "hub"), 3u);
}

TEST(DidYouMean, NeverNamesTheWordItself) {
  constexpr std::array<std::string_view, 2> kWords{"robot", "robot2"};
  EXPECT_EQ(did_you_mean("robot", kWords), "; did you mean robot2?");
  EXPECT_EQ(did_you_mean("robot", std::array<std::string_view, 1>{"robot"}), "");
}

TEST(DidYouMean, IsSilentWhenNothingIsNear) {
  constexpr std::array<std::string_view, 2> kWords{"--listen", "--limit"};
  EXPECT_EQ(did_you_mean("--colour-scheme", kWords), "");
  EXPECT_EQ(did_you_mean("x", {}), "");
  constexpr std::array<std::string_view, 2> kShort{"B", "hz"};
  for (const char* word : {"7", "99", "zq", "x"}) EXPECT_EQ(did_you_mean(word, kShort), "") << word;
  EXPECT_EQ(did_you_mean("foo", std::array<std::string_view, 1>{"log"}), "");
  EXPECT_EQ(did_you_mean("b1", kShort), "; did you mean B?");
  EXPECT_EQ(did_you_mean("h", kShort), "; did you mean hz?");
}

}  // namespace
}  // namespace gimnet
