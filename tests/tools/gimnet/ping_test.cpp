#include "tools/gimnet/ping.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace gimnet::tool {
namespace {

TEST(RoundTrips, AreNoNumbersWithoutAny) {
  const auto us = RoundTrips().summary_us();
  for (const double value : {us.min, us.mean, us.p50, us.p99, us.p99_9, us.max})
    EXPECT_TRUE(std::isnan(value));
}

TEST(RoundTrips, OfOneAreAllTheSame) {
  RoundTrips trips;
  trips.add(5000);
  const auto us = trips.summary_us();
  EXPECT_EQ(us.min, 5.0);
  EXPECT_EQ(us.p50, 5.0);
  EXPECT_EQ(us.p99_9, 5.0);
}

TEST(RoundTrips, HavePercentilesThatWereMeasured) {
  RoundTrips trips;
  for (int i = 1000; i >= 1; --i) trips.add(i * 1000);
  const auto us = trips.summary_us();
  EXPECT_EQ(us.min, 1.0);
  EXPECT_EQ(us.mean, 500.5);
  EXPECT_EQ(us.p50, 500.0);
  EXPECT_EQ(us.p99, 990.0);
  EXPECT_EQ(us.p99_9, 999.0);
  EXPECT_EQ(us.max, 1000.0);
}

}  // namespace
}  // namespace gimnet::tool
