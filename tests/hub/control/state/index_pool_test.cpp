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

TEST(IndexPool, HandsOutWhatIsGrantedAndThenThatAgainButNothingElse) {
  IndexPool pool(10, 0ms, {4, 3});
  for (std::uint32_t i = 4; i <= 6; ++i) EXPECT_EQ(pool.take(0ms), i);
  EXPECT_EQ(pool.take(0ms), std::nullopt);
  pool.give_back(5, 0ms);
  EXPECT_EQ(pool.take(0ms), 5u);
  EXPECT_EQ(pool.take(0ms), std::nullopt);
  pool.grant(4);
  EXPECT_EQ(pool.take(0ms), 7u);
  EXPECT_EQ(pool.take(0ms), std::nullopt);
}

TEST(IndexPool, GrantsComeRoundAtTheEndOfTheRange) {
  IndexPool pool(10, 0ms, {9, 3});
  EXPECT_EQ(pool.take(0ms), 9u);
  EXPECT_EQ(pool.take(0ms), 10u);
  EXPECT_EQ(pool.take(0ms), 1u);
  EXPECT_EQ(pool.take(0ms), std::nullopt);
  EXPECT_EQ(pool.mark(3), 2u);
  pool.grant(25);
  for (std::uint32_t i = 2; i <= 8; ++i) EXPECT_EQ(pool.take(0ms), i);
  EXPECT_EQ(pool.take(0ms), std::nullopt) << "all ten are held";
}

TEST(IndexPool, RunsShortWhenHalfABlockIsLeft) {
  IndexPool pool(100'000, 0ms, {1, IndexPool::kBlock});
  for (std::uint32_t i = 0; i < IndexPool::kBlock / 2; ++i) ASSERT_TRUE(pool.take(0ms));
  EXPECT_FALSE(pool.runs_short());
  ASSERT_TRUE(pool.take(0ms));
  EXPECT_TRUE(pool.runs_short());
  EXPECT_EQ(pool.mark(pool.next_count()), 1 + 2 * IndexPool::kBlock);
  pool.grant(pool.next_count());
  EXPECT_FALSE(pool.runs_short());
  EXPECT_FALSE(IndexPool(10, 0ms).runs_short());
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
  pool.grant(4);
  EXPECT_EQ(pool.take(0s), 9u) << "8 is held by one who came back";
  EXPECT_EQ(pool.held(), 6u);
}

}  // namespace
}  // namespace gimnet::hub
