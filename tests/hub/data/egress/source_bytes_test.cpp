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

}  // namespace
}  // namespace gimnet::hub
