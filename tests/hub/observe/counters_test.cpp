#include "hub/observe/counters.hpp"

#include <gtest/gtest.h>

#include "hub/data/tally.hpp"

namespace gimnet::hub {
namespace {

TEST(Counter, AddsSubtractsAndKeepsTheHighest) {
  Counter counter;
  counter.add(5);
  counter.subtract(2);
  EXPECT_EQ(counter.value(), 3u);
  counter.raise_to(2);
  EXPECT_EQ(counter.value(), 3u);
  counter.raise_to(9);
  EXPECT_EQ(counter.value(), 9u);
  counter.store(1);
  EXPECT_EQ(counter.value(), 1u);
}

TEST(Counter, StaysWithinABoundThatItIsGiven) {
  Counter counter;
  counter.add_within(7, 10);
  counter.add_within(3, 10);
  EXPECT_EQ(counter.value(), 10u);
  counter.add_within(1, 10);
  counter.add_within(UINT64_MAX, 10);
  EXPECT_EQ(counter.value(), 10u);
  counter.add_within(UINT64_MAX, UINT64_MAX);
  EXPECT_EQ(counter.value(), UINT64_MAX);
  counter.add_within(1, 10);
  EXPECT_EQ(counter.value(), UINT64_MAX) << "what is above it stays";
}

TEST(Tally, PublishesWhatCameSinceTheLastTime) {
  ShardCounters counters;
  Tally tally;
  tally.accepted = 3;
  tally.queued = 2;
  tally.drop(proto::DropReason::queue_full, 1);
  tally.publish(counters);
  EXPECT_EQ(counters.accepted.value(), 3u);
  EXPECT_EQ(counters.queued.value(), 2u);
  EXPECT_EQ(counters.dropped[static_cast<std::size_t>(proto::DropReason::queue_full)].value(), 1u);
  tally.queued = -2;
  tally.delivered = 2;
  tally.publish(counters);
  EXPECT_EQ(counters.accepted.value(), 3u);
  EXPECT_EQ(counters.queued.value(), 0u);
  EXPECT_EQ(counters.delivered.value(), 2u);
}

}  // namespace
}  // namespace gimnet::hub
