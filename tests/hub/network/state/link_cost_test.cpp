#include "hub/network/state/link_cost.hpp"

#include <gtest/gtest.h>

namespace gimnet::hub {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

TEST(LinkCost, IsTenPlusTheRoundTrip) {
  LinkCost cost;
  EXPECT_FALSE(cost.value());
  EXPECT_TRUE(cost.note_round_trip(milliseconds(30)));
  EXPECT_EQ(cost.value(), 40);
  LinkCost near;
  EXPECT_TRUE(near.note_round_trip(microseconds(20)));
  EXPECT_EQ(near.value(), 11);
  LinkCost far;
  EXPECT_TRUE(far.note_round_trip(std::chrono::minutes(10)));
  EXPECT_EQ(far.value(), LinkCost::kMost);
}

TEST(LinkCost, OnlyFallsAndByAQuarterAtLeast) {
  LinkCost cost;
  EXPECT_TRUE(cost.note_round_trip(milliseconds(90)));
  EXPECT_FALSE(cost.note_round_trip(milliseconds(500)));
  EXPECT_FALSE(cost.note_round_trip(milliseconds(66)));
  EXPECT_EQ(cost.value(), 100);
  EXPECT_TRUE(cost.note_round_trip(milliseconds(65)));
  EXPECT_EQ(cost.value(), 75);
}

TEST(LinkCost, StaysAsConfigured) {
  LinkCost cost(500);
  EXPECT_FALSE(cost.note_round_trip(milliseconds(1)));
  EXPECT_EQ(cost.value(), 500);
}

}  // namespace
}  // namespace gimnet::hub
