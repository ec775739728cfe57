#include "tools/demo/monitor.hpp"

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
  EXPECT_EQ(monitor.odometry_age().percentile_ns(0), 2000);
  EXPECT_EQ(monitor.loop_age().percentile_ns(100), 2500);
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
}  // namespace gimnet::demo
