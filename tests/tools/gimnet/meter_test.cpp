#include "tools/gimnet/meter.hpp"

#include <gtest/gtest.h>

namespace gimnet::tool {
namespace {

constexpr std::int64_t kMs = 1'000'000;
constexpr std::int64_t kSecond = 1000 * kMs;

TEST(Statistics, OfNothingAreZero) {
  const Statistics none;
  EXPECT_EQ(none.count(), 0u);
  EXPECT_EQ(none.mean(), 0.0);
  EXPECT_EQ(none.deviation(), 0.0);
}

TEST(Statistics, KeepsLeastMostMeanAndDeviation) {
  Statistics values;
  for (const double value : {2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0}) values.add(value);
  EXPECT_EQ(values.count(), 8u);
  EXPECT_EQ(values.min(), 2.0);
  EXPECT_EQ(values.max(), 9.0);
  EXPECT_DOUBLE_EQ(values.mean(), 5.0);
  EXPECT_DOUBLE_EQ(values.sum(), 40.0);
  EXPECT_DOUBLE_EQ(values.deviation(), 2.0);
}

TEST(Meter, ANewOneSaysNothingCame) {
  Meter meter(0, 5 * kSecond);
  const Reading reading = meter.recent(2 * kSecond);
  EXPECT_EQ(reading.rate_hz(), 0.0);
  EXPECT_EQ(reading.bytes_per_s(), 0.0);
  EXPECT_EQ(reading.seconds, 2.0);
  EXPECT_EQ(reading.silent_s, 2.0);
}

TEST(Meter, MeasuresTheRateByTheGaps) {
  Meter meter(0, 5 * kSecond);
  for (std::int64_t ms = 100; ms <= 1100; ms += 25) meter.add(ms * kMs, 10);
  const Reading reading = meter.recent(1110 * kMs);
  EXPECT_DOUBLE_EQ(reading.rate_hz(), 40.0);
  EXPECT_DOUBLE_EQ(reading.gaps_ms.min(), 25.0);
  EXPECT_DOUBLE_EQ(reading.gaps_ms.max(), 25.0);
  EXPECT_EQ(reading.sizes_bytes.count(), 41u);
  EXPECT_DOUBLE_EQ(reading.silent_s, 0.01);
}

TEST(Meter, ForgetsWhatIsOlderThanTheWindowButNotInTheWhole) {
  Meter meter(0, kSecond);
  meter.add(100 * kMs, 1000);
  meter.add(2000 * kMs, 10);
  meter.add(2500 * kMs, 30);
  const Reading recent = meter.recent(3000 * kMs);
  EXPECT_EQ(recent.sizes_bytes.count(), 2u);
  EXPECT_DOUBLE_EQ(recent.bytes_per_s(), 40.0);
  EXPECT_DOUBLE_EQ(recent.gaps_ms.max(), 1900.0) << "a gap counts where it ends";
  const Reading whole = meter.whole(3000 * kMs);
  EXPECT_EQ(whole.sizes_bytes.count(), 3u);
  EXPECT_DOUBLE_EQ(whole.sizes_bytes.max(), 1000.0);
  EXPECT_DOUBLE_EQ(whole.seconds, 3.0);
}

TEST(Meter, AMessageAtTheEdgeOfTheWindowCountsAndOneBeforeDoesNot) {
  Meter meter(0, kSecond);
  meter.add(kSecond - 1, 1);
  meter.add(kSecond, 1);
  EXPECT_EQ(meter.recent(2 * kSecond).sizes_bytes.count(), 1u);
}

TEST(Meter, ASlowServiceHasARateThoughItsWindowHoldsOneMessage) {
  Meter meter(0, kSecond);
  meter.add(1 * kSecond, 1);
  meter.add(11 * kSecond, 1);
  EXPECT_DOUBLE_EQ(meter.recent(11 * kSecond + kMs).rate_hz(), 0.1);
}

TEST(Meter, AClockThatIsSetBackMakesNoNegativeGap) {
  Meter meter(0, 10 * kSecond);
  meter.add(5 * kSecond, 1);
  meter.add(4 * kSecond, 1);
  EXPECT_EQ(meter.whole(4 * kSecond).gaps_ms.min(), 0.0);
  EXPECT_EQ(meter.whole(3 * kSecond).silent_s, 0.0);
}

TEST(Meter, RemembersALimitedNumberOfMessages) {
  Meter meter(0, 3600 * kSecond);
  for (std::size_t i = 0; i <= Meter::kMessagesMax; ++i) meter.add(static_cast<std::int64_t>(i), 1);
  EXPECT_EQ(meter.recent(kSecond).sizes_bytes.count(), Meter::kMessagesMax);
  EXPECT_EQ(meter.whole(kSecond).sizes_bytes.count(), Meter::kMessagesMax + 1);
}

}  // namespace
}  // namespace gimnet::tool
