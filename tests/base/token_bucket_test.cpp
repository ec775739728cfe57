#include "base/token_bucket.hpp"

#include <gtest/gtest.h>

namespace gimnet {
namespace {

using namespace std::chrono_literals;

int take_all(TokenBucket& bucket, const TokenBucket::Rate& rate, std::chrono::milliseconds now) {
  int taken = 0;
  while (bucket.take(rate, now)) ++taken;
  return taken;
}

TEST(TokenBucket, HoldsItsBurstAndNotOneMore) {
  TokenBucket bucket;
  EXPECT_EQ(take_all(bucket, {500, 2'048}, 5s), 2'048);
  EXPECT_FALSE(bucket.take({500, 2'048}, 5s));
}

TEST(TokenBucket, FillsByItsRate) {
  TokenBucket bucket;
  const TokenBucket::Rate rate{500, 2'048};
  take_all(bucket, rate, 0s);
  EXPECT_FALSE(bucket.take(rate, 1ms)) << "half of one";
  EXPECT_TRUE(bucket.take(rate, 2ms));
  EXPECT_FALSE(bucket.take(rate, 2ms));
  EXPECT_EQ(take_all(bucket, rate, 1'002ms), 500);
}

TEST(TokenBucket, NeverHoldsMoreThanItsBurst) {
  TokenBucket bucket;
  const TokenBucket::Rate rate{1'000'000'000, 3};
  EXPECT_EQ(take_all(bucket, rate, 0ms), 3);
  EXPECT_EQ(take_all(bucket, rate, 1ms), 3);
  EXPECT_EQ(take_all(bucket, rate, std::chrono::milliseconds::max()), 3);
  TokenBucket slow;
  EXPECT_EQ(take_all(slow, {1, 1'000'000}, 1h), 1'000'000);
}

TEST(TokenBucket, FollowsARateThatChanges) {
  TokenBucket bucket;
  EXPECT_TRUE(bucket.take({1, 100}, 0ms));
  EXPECT_EQ(take_all(bucket, {1, 10}, 0ms), 10);
  EXPECT_EQ(take_all(bucket, {20, 100}, 500ms), 10);
}

TEST(TokenBucket, AClockThatGoesBackFillsNothing) {
  TokenBucket bucket;
  EXPECT_EQ(take_all(bucket, {10, 2}, 10s), 2);
  EXPECT_FALSE(bucket.take({10, 2}, 1s));
  EXPECT_TRUE(bucket.take({10, 2}, 1'100ms)) << "and time goes on from there";
}

}  // namespace
}  // namespace gimnet
