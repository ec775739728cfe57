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

}  // namespace
}  // namespace gimnet::hub
