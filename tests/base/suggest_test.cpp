#include "base/suggest.hpp"

#include <gtest/gtest.h>

#include <array>
#include <vector>

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

TEST(DidYouMean, OfTwoAsNearNamesTheOneThatTheWordBegins) {
  constexpr std::array<std::string_view, 4> kWords{"pub", "hubs", "hug", "sub"};
  EXPECT_EQ(did_you_mean("hub", kWords), "; did you mean hubs?");
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

namespace {

std::string wrong(const std::vector<const char*>& words) {
  return wrong_option_word(words, [](std::string_view name) {
    if (name == "--help") return Takes::nothing;
    if (name == "--spin") return Takes::boolean;
    return name == "--name" || name == "-n" ? Takes::value : Takes::unknown;
  });
}

TEST(OptionWords, AFlagIsTrueOrFalse) {
  EXPECT_EQ(wrong({"--spin", "--spin=true", "--spin=false"}), "");
  for (const std::string value : {"", "2", "True", "no", "true ", "=true"}) {
    const std::string word = "--spin=" + value;
    EXPECT_EQ(wrong({"--spin", word.c_str(), "--spin=maybe"}),
              "--spin cannot be '" + value + "': write --spin alone, --spin=true or --spin=false");
  }
}

TEST(OptionWords, AnEmptyValueIsNotTheNextWord) {
  EXPECT_EQ(wrong({"--name=", "--spin"}), "--name is empty: give it a value, or leave it out");
  EXPECT_EQ(wrong({"--name", "", "--name=x", "--name=="}), "");
}

TEST(OptionWords, AnotherOptionIsNoValue) {
  EXPECT_EQ(wrong({"--name", "--spin"}),
            "--name needs a value, and '--spin' looks like an option; if it is meant, write "
            "--name=--spin");
  EXPECT_EQ(
      wrong({"-n", "--name=x"}),
      "-n needs a value, and '--name=x' looks like an option; if it is meant, write -n--name=x");
  for (const char* word : {"--", "--other", "--spin=2", "-n", "-n=3"})
    EXPECT_NE(wrong({"--name", word}), "") << word;
  for (const char* word : {"-", "-1", "-.5", "-x", "- no", "spin", "a--b"})
    EXPECT_EQ(wrong({"--name", word}), "");
  EXPECT_EQ(wrong({"--name=--spin", "--name=-n"}), "");
  EXPECT_EQ(wrong({"--name", "x", "--spin", "-n"}), "")
      << "that one is missing is for others to say";
}

TEST(OptionWords, WhatTakesNothingIsGivenNothing) {
  EXPECT_EQ(wrong({"--help"}), "");
  for (const char* word : {"--help=", "--help=true", "--help=false"}) {
    EXPECT_EQ(wrong({word}), "--help takes no value: write --help alone, or leave it out");
  }
}

TEST(OptionWords, OtherWordsAreNotLookedAt) {
  EXPECT_EQ(wrong({}), "");
  EXPECT_EQ(wrong({"spin=2", "--other=2", "--other=", "-"}), "");
  EXPECT_EQ(wrong({"--", "--spin=2"}), "");
  EXPECT_NE(wrong({"--name=x", "--spin=2"}), "");
  EXPECT_EQ(wrong({"--name"}), "");
}

}  // namespace

}  // namespace gimnet
