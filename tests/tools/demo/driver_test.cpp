#include "tools/demo/driver.hpp"

#include <gtest/gtest.h>

#include "tools/demo/simulated_robot.hpp"
#include "tools/demo/world_map.hpp"

namespace gimnet::demo {
namespace {

constexpr std::int64_t kNow_ns = 1'000'000'000'000;

Monitor in_the_hall() {
  Monitor monitor(0);
  RobotInfo info;
  info.map = WorldMap::hall().text();
  monitor.take(info, 0);
  Odometry odometry;
  odometry.stamp.number = 1;
  odometry.pose = WorldMap::hall().start();
  monitor.take(odometry, 0);
  return monitor;
}

Monitor at_a_log() {
  Monitor monitor(0);
  RobotInfo info;
  info.source = "a.log";
  info.speed = 2.0;
  monitor.take(info, 0);
  return monitor;
}

TEST(Driver, SaysNothingToARobotThatWasNotHeard) {
  Driver driver(true);
  EXPECT_FALSE(driver.next(Monitor(0), kNow_ns));
}

TEST(Driver, CommandsASimulatedRobotSteadily) {
  Driver driver(false);
  const Monitor monitor = in_the_hall();
  int commands = 0;
  (void)driver.next(monitor, kNow_ns);
  for (int millisecond = 1; millisecond <= 1000; ++millisecond) {
    while (driver.next(monitor, kNow_ns + millisecond * 1'000'000)) ++commands;
  }
  EXPECT_NEAR(commands, 20, 2);
}

TEST(Driver, TheCourseDrivesUntilSomebodyTakesTheWheel) {
  Driver driver(true);
  const Monitor monitor = in_the_hall();
  const std::optional<DriveCommand> first = driver.next(monitor, kNow_ns);
  ASSERT_TRUE(first);
  EXPECT_NE(first->twist.angular_radps, 0.0);
  driver.press(Keystroke::kForward, monitor, kNow_ns);
  EXPECT_FALSE(driver.autopilot());
  const std::optional<DriveCommand> second = driver.next(monitor, kNow_ns + Driver::kPeriod_ns);
  ASSERT_TRUE(second);
  EXPECT_EQ(second->twist.linear_mps, Teleop::kLinear_mps);
  EXPECT_EQ(second->stamp.number, first->stamp.number + 1);
  driver.press(Keystroke::kAutopilot, monitor, kNow_ns);
  EXPECT_TRUE(driver.autopilot());
}

TEST(Driver, TellsALogOnlyWhatChanges) {
  Driver driver(false);
  const Monitor monitor = at_a_log();
  EXPECT_FALSE(driver.next(monitor, kNow_ns));
  driver.press(Keystroke::kFaster, monitor, kNow_ns);
  EXPECT_EQ(driver.next(monitor, kNow_ns)->speed, 5.0);
  EXPECT_FALSE(driver.next(monitor, kNow_ns + 1'000'000'000));
  driver.press(Keystroke::kSlower, monitor, kNow_ns);
  driver.press(Keystroke::kSlower, monitor, kNow_ns);
  EXPECT_EQ(driver.next(monitor, kNow_ns)->speed, 1.0);
  driver.press(Keystroke::kStop, monitor, kNow_ns);
  EXPECT_TRUE(driver.next(monitor, kNow_ns)->paused);
  driver.press(Keystroke::kStop, monitor, kNow_ns);
  EXPECT_FALSE(driver.next(monitor, kNow_ns)->paused);
  EXPECT_EQ(driver.commands(), 4U);
}

TEST(Driver, SpeedsHaveEnds) {
  Driver driver(false);
  const Monitor monitor = at_a_log();
  for (int press = 0; press < 20; ++press) driver.press(Keystroke::kFaster, monitor, kNow_ns);
  EXPECT_EQ(driver.next(monitor, kNow_ns)->speed, 100.0);
  for (int press = 0; press < 20; ++press) driver.press(Keystroke::kSlower, monitor, kNow_ns);
  EXPECT_EQ(driver.next(monitor, kNow_ns)->speed, 0.1);
}

TEST(Driver, FinishesOnceAndForAll) {
  Driver driver(true);
  const Monitor monitor = in_the_hall();
  driver.finish();
  const std::optional<DriveCommand> last = driver.next(monitor, kNow_ns);
  ASSERT_TRUE(last);
  EXPECT_TRUE(last->finish);
  EXPECT_EQ(last->twist.linear_mps, 0.0);
  EXPECT_FALSE(driver.next(monitor, kNow_ns + 1'000'000'000));
}

}  // namespace

namespace {

TEST(Course, WithoutCornersItStandsStill) {
  Course course({});
  EXPECT_EQ(course.steer({}).linear_mps, 0.0);
  EXPECT_EQ(course.steer({}).angular_radps, 0.0);
}

TEST(Course, TurnsFirstWhereTheCornerIsBehind) {
  Course course({{-5.0, 0.1}});
  EXPECT_EQ(course.steer({}).linear_mps, 0.0);
  EXPECT_GT(course.steer({}).angular_radps, 1.0);
}

TEST(Course, DrivesAheadWhereTheCornerIs) {
  Course course({{5.0, 0.0}});
  EXPECT_GT(course.steer({}).linear_mps, 0.9);
  EXPECT_EQ(course.steer({}).angular_radps, 0.0);
}

TEST(Course, GoesRoundTheHallWithoutABump) {
  const WorldMap map = WorldMap::hall();
  DifferentialDrive drive(map.start(), DriveSpec{});
  Course course(map.waypoints());
  for (int step = 0; step < 40 * 120; ++step) {
    drive.step(course.steer(drive.pose()), 0.025, map);
    ASSERT_FALSE(drive.bumped()) << step << ": " << drive.pose().x_m << ", " << drive.pose().y_m;
  }
  EXPECT_GE(course.reached(), 2 * map.waypoints().size());
}

}  // namespace

}  // namespace gimnet::demo
