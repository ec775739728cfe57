#include "hub/data/egress/source_bytes.hpp"

#include <gtest/gtest.h>

#include <set>

namespace gimnet::hub {
namespace {

constexpr std::uint64_t kLaneBytes = 3'200;  // 100 bytes from one choice to the next
constexpr std::uint8_t kOne = 3;
constexpr std::uint8_t kOther = 9;

TEST(SourceBytes, NeighboursHaveCountersOfTheirOwn) {
  for (const std::uint32_t hub : {0u, 7u, 4'094u}) {
    std::set<std::uint8_t> places;
    for (std::uint32_t index = 1; index <= SourceBytes::kSources; ++index)
      places.insert(SourceBytes::place_of(NodeId{hub << 20 | index}));
    EXPECT_EQ(places.size(), SourceBytes::kSources);
    EXPECT_EQ(*places.rbegin(), SourceBytes::kSources - 1);
  }
}

TEST(SourceBytes, TheOneWithTheMostLosesUntilItLostA32ndOfTheLane) {
  SourceBytes sources;
  EXPECT_TRUE(sources.choice_due());
  sources.add(kOne, 1'000);
  sources.add(kOther, 1'050);
  EXPECT_TRUE(sources.choice_due());
  sources.choose(kLaneBytes);
  EXPECT_EQ(sources.loser(), kOther);
  EXPECT_EQ(sources.floor(), 950u);
  sources.take(kOther, 99);
  EXPECT_FALSE(sources.choice_due()) << "though the other one has more";
  sources.take(kOther, 1);
  EXPECT_TRUE(sources.choice_due());
  sources.choose(kLaneBytes);
  EXPECT_EQ(sources.loser(), kOne);
}

TEST(SourceBytes, WhatIsNeverDroppedLosesNothingButFills) {
  SourceBytes sources;
  sources.add(kOne + SourceBytes::kFixed, 2'000);
  sources.add(kOther, 100);
  sources.choose(kLaneBytes);
  EXPECT_EQ(sources.loser(), kOther);
  EXPECT_EQ(sources.fullest(), kOne);
  EXPECT_EQ(sources.droppable(kOne), 0u);
}

TEST(SourceBytes, AChoiceOfOneIsNone) {
  SourceBytes sources;
  EXPECT_TRUE(sources.at_most_one());
  EXPECT_TRUE(sources.is_alone(kOne)) << "where nobody has anything";
  sources.add(kOne, 100);
  EXPECT_TRUE(sources.is_alone(kOne));
  EXPECT_FALSE(sources.is_alone(kOther));
  sources.choose(kLaneBytes);
  EXPECT_EQ(sources.loser(), kOne);
  EXPECT_TRUE(sources.choice_due()) << "once another one comes";
  sources.add(kOther, 1);
  EXPECT_FALSE(sources.at_most_one());
  sources.choose(kLaneBytes);
  EXPECT_EQ(sources.floor(), 0u);
  EXPECT_FALSE(sources.choice_due());
}

TEST(SourceBytes, TheSmallestLaneHasAChoiceToo) {
  SourceBytes sources;
  sources.add(kOne, 10);
  sources.add(kOther, 20);
  sources.choose(1);
  EXPECT_FALSE(sources.choice_due());
  EXPECT_EQ(sources.floor(), 19u);
}

}  // namespace
}  // namespace gimnet::hub
