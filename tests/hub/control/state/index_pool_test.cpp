#include "hub/control/state/index_pool.hpp"

#include <gtest/gtest.h>

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;

TEST(IndexPool, BeginsAtOneAndGoesUp) {
  IndexPool pool(10, 1s);
  EXPECT_EQ(pool.take(0ms), 1u);
  EXPECT_EQ(pool.take(0ms), 2u);
  EXPECT_EQ(pool.held(), 2u);
}

TEST(IndexPool, HandsOutTheWholeRangeAndNotOneMore) {
  IndexPool pool(3, 1s);
  for (std::uint32_t i = 1; i <= 3; ++i) EXPECT_EQ(pool.take(0ms), i);
  EXPECT_EQ(pool.take(0ms), std::nullopt);
}

TEST(IndexPool, GoesOnCyclicallyInsteadOfReusingAtOnce) {
  IndexPool pool(3, 0ms);
  ASSERT_EQ(pool.take(0ms), 1u);
  pool.give_back(1, 0ms);
  EXPECT_EQ(pool.take(0ms), 2u);
  EXPECT_EQ(pool.take(0ms), 3u);
  EXPECT_EQ(pool.take(0ms), 1u);
}

TEST(IndexPool, AnIndexRestsForItsTimeExactly) {
  IndexPool pool(1, 40s);
  ASSERT_EQ(pool.take(5s), 1u);
  pool.give_back(1, 10s);
  EXPECT_EQ(pool.held(), 0u);
  EXPECT_EQ(pool.take(50s - 1ms), std::nullopt);
  EXPECT_EQ(pool.take(50s), 1u);
}

TEST(IndexPool, SkipsWhatIsHeldAfterComingRound) {
  IndexPool pool(3, 0ms);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(pool.take(0ms));
  pool.give_back(2, 0ms);
  EXPECT_EQ(pool.take(0ms), 2u);
  pool.give_back(3, 0ms);
  pool.give_back(1, 0ms);
  EXPECT_EQ(pool.take(0ms), 3u);
  EXPECT_EQ(pool.take(0ms), 1u);
}

/// Takes a grant as a hub that can write its state does.
IndexPool::Grant keep(IndexPool& pool, std::chrono::milliseconds now = 0ms) {
  const IndexPool::Grant grant = pool.next_grant(now);
  pool.grant(grant);
  return grant;
}

IndexSet all_from_to(std::uint32_t first, std::uint32_t last) {
  IndexSet set;
  for (std::uint32_t index = first; index <= last; ++index) set.insert(index);
  return set;
}

TEST(IndexPool, HandsOutWhatIsGrantedAndNothingElseNorAnyTwice) {
  IndexPool pool(10, 0ms, {4, 3});
  for (std::uint32_t i = 4; i <= 6; ++i) EXPECT_EQ(pool.take(0ms), i);
  EXPECT_EQ(pool.take(0ms), std::nullopt);
  pool.give_back(5, 0ms);
  EXPECT_EQ(pool.take(0ms), std::nullopt) << "5 is used";
  EXPECT_TRUE(pool.keeping_due(0ms));
  EXPECT_EQ(keep(pool).used, all_from_to(1, 10));
  for (const std::uint32_t next : {7u, 8u, 9u, 10u, 1u, 2u, 3u}) EXPECT_EQ(pool.take(0ms), next);
  EXPECT_EQ(pool.take(0ms), std::nullopt);
  EXPECT_TRUE(pool.keeping_due(0ms));
  keep(pool);
  EXPECT_EQ(pool.take(0ms), 5u) << "what is used and nobody has is forgotten";
}

TEST(IndexPool, GrantsABlockAheadAndSaysItIsUsed) {
  IndexPool pool(100'000, 0ms, {1, IndexPool::kBlock});
  for (std::uint32_t i = 0; i < IndexPool::kBlock / 2; ++i) ASSERT_TRUE(pool.take(0ms));
  EXPECT_FALSE(pool.keeping_due(0ms));
  EXPECT_EQ(pool.next_grant(0ms).count, IndexPool::kBlock)
      << "asked for another reason, nothing more is granted";
  ASSERT_TRUE(pool.take(0ms));
  EXPECT_TRUE(pool.keeping_due(0ms));
  const IndexPool::Grant grant = keep(pool);
  EXPECT_EQ(grant.mark, 1 + 2 * IndexPool::kBlock);
  EXPECT_EQ(grant.used, all_from_to(1, 2 * IndexPool::kBlock));
  EXPECT_FALSE(grant.forgets_gone);
  EXPECT_FALSE(pool.keeping_due(0ms));
  EXPECT_FALSE(IndexPool(10, 0ms).keeping_due(0ms)) << "of which nothing outlives the hub";
}

TEST(IndexPool, ABlockIsOfIndicesThatAreNotUsed) {
  IndexPool pool(100'000, 0ms, {99'999, 0, all_from_to(1, 40'000)});
  EXPECT_EQ(pool.take(0ms), std::nullopt) << "nothing is granted";
  const IndexPool::Grant grant = keep(pool);
  EXPECT_EQ(grant.mark, 40'001 + IndexPool::kBlock - 2);
  EXPECT_EQ(pool.take(0ms), 99'999u);
  EXPECT_EQ(pool.take(0ms), 100'000u);
  EXPECT_EQ(pool.take(0ms), 40'001u);
}

TEST(IndexPool, WhatIsTakenBeyondTheGrantedHasToBeKept) {
  IndexPool pool(100'000, 1s, {1, IndexPool::kBlock, all_from_to(50'000, 50'001)});
  EXPECT_TRUE(pool.take_free(9, 0ms));
  EXPECT_TRUE(pool.take_back(50'000));
  EXPECT_FALSE(pool.keeping_due(0ms)) << "a crash forgets neither";
  EXPECT_FALSE(pool.used(60'000));
  EXPECT_TRUE(pool.take_free(60'000, 0ms));
  EXPECT_TRUE(pool.used(60'000));
  EXPECT_TRUE(pool.keeping_due(0ms));
  EXPECT_TRUE(keep(pool).used.contains(60'000));
  EXPECT_FALSE(pool.keeping_due(0ms));
  EXPECT_TRUE(pool.take_back(60'001));
  EXPECT_TRUE(pool.keeping_due(0ms));
}

TEST(IndexPool, WhatIsLetGoDoesNotRestAndStaysUsed) {
  IndexPool pool(100'000, 1s, {1, IndexPool::kBlock});
  ASSERT_TRUE(pool.take_free(60'000, 0ms));
  EXPECT_TRUE(pool.unkept());
  pool.let_go(60'000);
  EXPECT_EQ(pool.held(), 0u);
  EXPECT_TRUE(pool.used(60'000));
  EXPECT_TRUE(pool.unkept()) << "until it is kept";
  ASSERT_TRUE(pool.take_free(60'000, 0ms));
  keep(pool);
  EXPECT_FALSE(pool.unkept());
}

TEST(IndexPool, OfAPoolThatKeepsNothingNothingIsUnkept) {
  IndexPool pool(100'000, 1s);
  ASSERT_TRUE(pool.take_free(60'000, 0ms));
  EXPECT_FALSE(pool.unkept());
}

TEST(IndexPool, ReturnsArePutOff) {
  IndexPool pool(100'000, 40s, {60'001, 0, all_from_to(1, 100'000)}, 30s);
  EXPECT_EQ(pool.waits_for_returns(30s), std::nullopt);
  pool.put_off_returns(60s, 80s);
  EXPECT_EQ(pool.waits_for_returns(30s), 50s);
  EXPECT_FALSE(pool.keeping_due(80s - 1ms));
  EXPECT_TRUE(pool.keeping_due(80s));
}

TEST(IndexPool, ForgetsWhoIsGoneWhenFewAreLeftAndNobodyMayReturn) {
  IndexPool pool(100'000, 40s, {60'001, 0, all_from_to(1, 60'000)}, 30s);
  ASSERT_TRUE(pool.take_back(1));
  ASSERT_TRUE(pool.take_back(2));
  pool.give_back(2, 10s);
  keep(pool);
  EXPECT_FALSE(pool.keeping_due(30s - 1ms));
  EXPECT_TRUE(pool.next_grant(30s - 1ms).used.contains(60'000));
  EXPECT_TRUE(pool.keeping_due(30s));
  const IndexPool::Grant grant = keep(pool, 30s);
  EXPECT_TRUE(grant.used.contains(1)) << "held";
  EXPECT_TRUE(grant.used.contains(2)) << "rests";
  EXPECT_FALSE(grant.used.contains(3));
  EXPECT_TRUE(grant.used.contains(60'001)) << "granted";
  EXPECT_EQ(grant.used.size(), 2 + IndexPool::kBlock);
  EXPECT_FALSE(pool.keeping_due(30s));
  EXPECT_EQ(pool.take(30s), 60'001u);
}

TEST(IndexPool, ForgetsNobodyWhileHalfAreLeft) {
  IndexPool pool(100'000, 0ms, {1, 0, all_from_to(50'001, 100'000)});
  keep(pool);
  EXPECT_FALSE(pool.keeping_due(0ms));
  ASSERT_TRUE(pool.take(0ms));
  EXPECT_TRUE(pool.keeping_due(0ms)) << "one fewer";
}

TEST(IndexPool, SaysHowLongAllAreWaitedFor) {
  IndexPool pool(100'000, 0ms, {1, 0, all_from_to(1, 99'999)}, 30s);
  EXPECT_EQ(pool.waits_for_returns(0ms), std::nullopt) << "one is left";
  keep(pool);
  EXPECT_EQ(pool.take(0ms), 100'000u);
  EXPECT_FALSE(pool.keeping_due(0ms)) << "it would not help";
  EXPECT_FALSE(pool.ready(1s));
  EXPECT_EQ(pool.waits_for_returns(1s), 29s);
  EXPECT_EQ(pool.waits_for_returns(30s), std::nullopt);
  keep(pool, 30s);
  EXPECT_TRUE(pool.ready(30s));
}

TEST(IndexPool, AFormerHolderNeedNotWaitForItsIndexToRest) {
  IndexPool pool(3, 40s);
  ASSERT_EQ(pool.take(0s), 1u);
  EXPECT_FALSE(pool.take_back(1)) << "held";
  pool.give_back(1, 0s);
  EXPECT_FALSE(pool.take_free(1, 10s)) << "rests";
  EXPECT_TRUE(pool.take_back(1));
  EXPECT_TRUE(pool.held(1));
  // Its first rest is over, but it is held again.
  EXPECT_EQ(pool.take(41s), 2u);
  pool.give_back(1, 50s);
  EXPECT_FALSE(pool.take_free(1, 89s)) << "the second rest counts from its own beginning";
  EXPECT_TRUE(pool.take_free(1, 90s));
}

TEST(IndexPool, WhoComesBackTakesAnIndexBelowTheGrantedOnes) {
  IndexPool pool(10, 1s, {6, 2});
  EXPECT_TRUE(pool.take_back(3));
  EXPECT_TRUE(pool.take_free(4, 0s));
  EXPECT_FALSE(pool.take_free(4, 0s));
  EXPECT_FALSE(pool.take_back(0));
  EXPECT_FALSE(pool.take_back(11));
  EXPECT_TRUE(pool.take_back(8)) << "not granted yet";
  EXPECT_EQ(pool.take(0s), 6u);
  EXPECT_EQ(pool.take(0s), 7u);
  EXPECT_EQ(pool.take(0s), std::nullopt);
  keep(pool);
  EXPECT_EQ(pool.take(0s), 9u) << "8 is held by one who came back";
  EXPECT_EQ(pool.held(), 6u);
}

}  // namespace
}  // namespace gimnet::hub
