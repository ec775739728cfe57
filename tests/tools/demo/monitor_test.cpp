#include "tools/demo/monitor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace gimnet::demo {
namespace {

Odometry odometry(std::uint64_t number, double x_m) {
  Odometry message;
  message.stamp = {number, 1000};
  message.pose.x_m = x_m;
  return message;
}

TEST(Monitor, CountsWhatIsMissing) {
  Monitor monitor(0);
  for (const std::uint64_t number : {1U, 2U, 5U, 6U}) monitor.take(odometry(number, 0), 2000);
  EXPECT_EQ(monitor.odometry_stream().received, 4U);
  EXPECT_EQ(monitor.odometry_stream().missed, 2U);
  EXPECT_EQ(monitor.odometry_stream().disordered, 0U);
  monitor.take(odometry(6, 0), 2000);
  EXPECT_EQ(monitor.odometry_stream().disordered, 1U);
}

TEST(Monitor, ExcusesMessagesThatWereMadeWhenTheirLossIsAsItShouldBe) {
  Monitor monitor(0);
  monitor.excuse_by([](std::int64_t made_ns) { return made_ns >= 3'000 && made_ns <= 4'000; });
  for (const std::uint64_t number : {1U, 6U, 9U}) {
    Odometry message = odometry(number, 0);
    message.stamp.made_ns = static_cast<std::int64_t>(number) * 1'000;
    monitor.take(message, 20'000);
  }
  EXPECT_EQ(monitor.odometry_stream().missed, 6U);
  EXPECT_EQ(monitor.odometry_stream().excused, 2U) << "number 3 and number 4";
}

TEST(Monitor, TheFirstMessageMustBeNumberOne) {
  Monitor monitor(0);
  monitor.take(odometry(4, 0), 2000);
  EXPECT_EQ(monitor.odometry_stream().missed, 3U);
}

TEST(Monitor, MeasuresAgesAndTheLoopOncePerCommand) {
  Monitor monitor(0);
  Odometry message = odometry(1, 0);
  message.answers = {1, 500};
  monitor.take(message, 3000);
  message.stamp.number = 2;
  monitor.take(message, 9000);
  EXPECT_EQ(monitor.odometry_stream().age.percentile_ns(0), 2000);
  EXPECT_EQ(monitor.drive_stream().age.percentile_ns(100), 2500);
}

TEST(Monitor, KeepsATrailAndThinsItOut) {
  Monitor monitor(0);
  const std::size_t steps = Monitor::kTrailPointsMax + 10;
  for (std::size_t step = 0; step < steps; ++step)
    monitor.take(odometry(step + 1, static_cast<double>(step) * 0.05), 1);
  EXPECT_LE(monitor.trail().size(), Monitor::kTrailPointsMax);
  EXPECT_EQ(monitor.trail().front().x_m, 0.0);
  EXPECT_NEAR(monitor.way_m(), static_cast<double>(steps - 1) * 0.05, 1e-6);
}

TEST(Monitor, ScansBecomeAMap) {
  Monitor monitor(0);
  Scan scan;
  scan.stamp.number = 1;
  scan.range_max_m = 10.0;
  scan.ranges_m = {2.0F};
  monitor.take(scan, 5);
  EXPECT_FALSE(monitor.seen().empty());
  EXPECT_EQ(monitor.scan()->ranges_m.size(), 1U);
}

TEST(Monitor, TakesThePlanOfTheHall) {
  Monitor monitor(0);
  RobotInfo info;
  info.map = WorldMap::hall().text();
  monitor.take(info, 0);
  ASSERT_TRUE(monitor.plan());
  EXPECT_EQ(monitor.plan()->width_m(), 18.0);
  info.map = "no map";
  monitor.take(info, 0);
  EXPECT_EQ(monitor.garbled_messages(), 1U);
}

}  // namespace

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
