#include "tools/demo/sample_window.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace gimnet::demo {
namespace {

using testing::ElementsAre;

TEST(SampleWindow, HasNoPercentileWithoutSamples) {
  EXPECT_FALSE(SampleWindow(4).percentile_ns(50));
}

TEST(SampleWindow, GivesTheNearestRank) {
  SampleWindow window(200);
  for (int sample = 100; sample >= 1; --sample) window.add(sample);
  EXPECT_EQ(window.percentile_ns(50), 50);
  EXPECT_EQ(window.percentile_ns(99), 99);
  EXPECT_EQ(window.percentile_ns(100), 100);
  EXPECT_EQ(window.percentile_ns(0), 1);
}

TEST(SampleWindow, ForgetsTheOldest) {
  SampleWindow window(3);
  for (int sample = 1; sample <= 5; ++sample) window.add(sample);
  EXPECT_THAT(window.latest(10), ElementsAre(3, 4, 5));
  EXPECT_THAT(window.latest(2), ElementsAre(4, 5));
  EXPECT_EQ(window.percentile_ns(1), 3);
}

constexpr std::int64_t kSecond_ns = 1'000'000'000;

TEST(RateMeter, MeasuresASteadyStream) {
  RateMeter meter;
  std::int64_t now_ns = 0;
  for (int event = 0; event < 400; ++event, now_ns += kSecond_ns / 40) meter.add(now_ns);
  EXPECT_NEAR(meter.rate_hz(now_ns), 40.0, 0.5);
}

TEST(RateMeter, IsRightBeforeItsWindowIsFull) {
  RateMeter meter;
  for (int event = 0; event <= 10; ++event) meter.add(event * kSecond_ns / 10);
  EXPECT_NEAR(meter.rate_hz(kSecond_ns), 10.0, 0.1);
}

TEST(RateMeter, GoesToZeroWhenNothingComes) {
  RateMeter meter;
  EXPECT_EQ(meter.rate_hz(5), 0.0);
  meter.add(0);
  EXPECT_EQ(meter.rate_hz(RateMeter::kWindow_ns + 1), 0.0);
}

}  // namespace
}  // namespace gimnet::demo
