#include "hub/data/egress/source_bytes.hpp"

#include <gtest/gtest.h>

#include <set>

namespace gimnet::hub {
namespace {

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

TEST(SourceBytes, TheOneWithTheMostLoses) {
  SourceBytes sources;
  sources.add(kOne, 1'000);
  EXPECT_EQ(sources.loser(), kOne);
  sources.add(kOther, 1'050);
  EXPECT_EQ(sources.loser(), kOther);
  sources.take(kOther, 51);
  EXPECT_EQ(sources.loser(), kOne);
}

TEST(SourceBytes, WhatIsNeverDroppedLosesNothingButFills) {
  SourceBytes sources;
  sources.add(kOne + SourceBytes::kFixed, 2'000);
  sources.add(kOther, 100);
  EXPECT_EQ(sources.loser(), kOther);
  EXPECT_EQ(sources.fullest(), kOne);
}

TEST(SourceBytes, CountsThoseThatHaveWhatIsNeverDropped) {
  SourceBytes sources;
  EXPECT_EQ(sources.fixed_sources(), 1u) << "nobody shares with nobody";
  sources.add(kOne + SourceBytes::kFixed, 2'000);
  sources.add(kOther + SourceBytes::kFixed, 100);
  sources.add(5, 100);
  EXPECT_EQ(sources.fixed_sources(), 2u);
  EXPECT_EQ(sources.fixed(kOne), 2'000u);
  const std::uint32_t below = sources.below(100);
  EXPECT_EQ(below >> kOne & 1, 0u);
  EXPECT_EQ(below >> kOther & 1, 1u);
  EXPECT_EQ(below >> 5 & 1, 1u);
}

}  // namespace
}  // namespace gimnet::hub
