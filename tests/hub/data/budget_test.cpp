#include "hub/data/budget.hpp"

#include <gtest/gtest.h>

#include <deque>

namespace gimnet::hub {
namespace {

constexpr std::uint64_t kMiB = 1 << 20;

TEST(BudgetLease, LeasesInPiecesAndGivesBack) {
  Budget budget(4 << 20);
  {
    BudgetLease lease(budget);
    lease.take(100);
    EXPECT_EQ(budget.left(), (4 << 20) - (64 << 10)) << "a 64th";
    lease.take(4 << 20);
    EXPECT_EQ(budget.left(), 0);
    EXPECT_TRUE(lease.exhausted());
    lease.give_back(100);
    EXPECT_FALSE(lease.exhausted()) << "exactly the budget";
    BudgetLease other(budget);
    other.take(1);
    EXPECT_TRUE(other.exhausted());
    lease.give_back(4 << 20);
    EXPECT_FALSE(other.exhausted()) << "what the other shard gave back";
    other.give_back(1);
  }
  EXPECT_EQ(budget.left(), 4 << 20);
}

TEST(BudgetLease, MemoryThatGrowsAndShrinksIsCountedOnce) {
  Budget budget(64 * kMiB);
  BudgetLease lease(budget);
  std::uint64_t counted = 0;
  lease.change(counted, 40 * kMiB);
  EXPECT_EQ(budget.left(), 24 << 20);
  lease.change(counted, 30 * kMiB);
  lease.change(counted, 40 * kMiB);
  EXPECT_EQ(budget.left(), 24 << 20);
  lease.change(counted, 0);
  EXPECT_EQ(counted, 0u);
  lease.take(64 * kMiB);
  EXPECT_FALSE(lease.exhausted()) << "all is free";
  lease.give_back(64 * kMiB);
}

TEST(BudgetLease, MemoryIsScarceWhileLessThanAThirdIsFree) {
  Budget budget(30 * kMiB);
  BudgetLease lease(budget);
  lease.take(20 * kMiB);
  lease.begin_turn(1'000);
  EXPECT_FALSE(lease.scarce()) << "exactly a third is free";
  lease.take(1);
  EXPECT_FALSE(lease.scarce()) << "it is asked once a turn";
  lease.begin_turn(1'000);
  EXPECT_TRUE(lease.scarce());
  lease.give_back(1);
  lease.begin_turn(1'000);
  EXPECT_FALSE(lease.scarce());
  lease.give_back(20 * kMiB);
}

TEST(BudgetLease, WhatAnotherShardHasLeasedIsNotFree) {
  Budget budget(192 * kMiB, 2);
  BudgetLease lease(budget);
  BudgetLease other(budget);
  other.take(128 * kMiB);
  lease.begin_turn(0);
  EXPECT_FALSE(lease.scarce());
  other.take(1);
  lease.begin_turn(0);
  EXPECT_TRUE(lease.scarce());
  other.give_back(128 * kMiB + 1);
}

TEST(BudgetLease, WhatShardsKeepUnusedMakesNoMemoryScarce) {
  constexpr std::size_t kShards = 16;
  for (const std::uint64_t bytes : {4 * kMiB, 16 * kMiB, 256 * kMiB}) {
    Budget budget(bytes, kShards);
    std::deque<BudgetLease> leases;
    for (std::size_t i = 0; i < kShards; ++i) {
      BudgetLease& lease = leases.emplace_back(budget);
      lease.take(kMiB);
      lease.give_back(kMiB);
    }
    for (BudgetLease& lease : leases) {
      lease.begin_turn(0);
      EXPECT_FALSE(lease.scarce()) << bytes;
    }
    EXPECT_GE(static_cast<std::uint64_t>(budget.left()), bytes - bytes / 21);
  }
}

TEST(BudgetLease, HasSpareWhileASixthIsFree) {
  Budget budget(30 * kMiB);
  BudgetLease lease(budget);
  lease.take(25 * kMiB);
  lease.begin_turn(1'000);
  EXPECT_TRUE(lease.scarce());
  EXPECT_TRUE(lease.has_spare()) << "exactly a sixth is free";
  lease.take(1);
  EXPECT_FALSE(lease.has_spare()) << "it is asked at once";
  lease.give_back(1);
  EXPECT_TRUE(lease.has_spare());
  lease.give_back(25 * kMiB);
}

TEST(BudgetLease, AShareIsASixthByTheConnectionsThatWaitWithinBounds) {
  Budget budget(30 * kMiB);
  BudgetLease lease(budget);
  lease.take(21 * kMiB);
  const auto share_of = [&](std::uint64_t waiting) {
    for (std::uint64_t i = 0; i < waiting; ++i) lease.begin_waiting();
    lease.begin_turn(0);
    const std::uint64_t share = lease.share_bytes();
    for (std::uint64_t i = 0; i < waiting; ++i) lease.end_waiting();
    return share;
  };
  EXPECT_EQ(share_of(0), 256u * 1024) << "nobody waits yet";
  EXPECT_EQ(share_of(20), 256u * 1024) << "exactly";
  EXPECT_EQ(share_of(21), 5 * kMiB / 21);
  EXPECT_EQ(share_of(1'280), 4u * 1024) << "exactly";
  EXPECT_EQ(share_of(1'281), 4u * 1024);
  lease.give_back(21 * kMiB);
}

TEST(BudgetLease, ShardsAddTheirsEveryTenMilliseconds) {
  Budget budget(30 * kMiB);
  BudgetLease lease(budget);
  {
    BudgetLease other(budget);
    lease.take(21 * kMiB);
    other.begin_turn(1'000);
    lease.begin_turn(1'000);
    for (int i = 0; i < 90; ++i) other.begin_waiting();
    for (int i = 0; i < 10; ++i) lease.begin_waiting();
    other.begin_turn(1'009);
    lease.begin_turn(1'009);
    EXPECT_EQ(lease.share_bytes(), 256u * 1024) << "its own are known at once";
    other.begin_turn(1'010);
    lease.begin_turn(1'009);
    EXPECT_EQ(lease.share_bytes(), 5 * kMiB / 100);
    lease.begin_turn(1'010);
    EXPECT_EQ(lease.share_bytes(), 5 * kMiB / 100) << "and count once";
  }
  lease.begin_turn(1'011);
  EXPECT_EQ(lease.share_bytes(), 256u * 1024) << "those of a shard that ended count no more";
  lease.give_back(21 * kMiB);
}

}  // namespace
}  // namespace gimnet::hub
