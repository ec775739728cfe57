#include "tools/demo/log_player.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <numbers>
#include <vector>

namespace gimnet::demo {
namespace {

constexpr std::int64_t kStart_ns = 1'000'000'000'000;
constexpr std::int64_t kSecond_ns = 1'000'000'000;

// Odometry each second, 1 m on, and a scan with the last.
RobotLog drive(int seconds) {
  RobotLog log;
  for (int second = 0; second <= seconds; ++second) {
    LogRecord record;
    record.due_s = second;
    record.pose.x_m = second;
    log.records.push_back(record);
  }
  LogRecord scan = log.records.back();
  scan.ranges_m = {1.0F, 2.0F, 3.0F};
  log.records.push_back(scan);
  log.scans = 1;
  return log;
}

struct Heard {
  std::vector<Odometry> odometry;
  std::vector<Scan> scans;
  RobotSource::Output output{[this](const Odometry& message) { odometry.push_back(message); },
                             [this](const Scan& message) { scans.push_back(message); }};
};

TEST(LogPlayer, PlaysAtRecordedSpeed) {
  LogPlayer player(drive(10), {"a.log", 1.0, kStart_ns});
  Heard heard;
  player.advance(kStart_ns, heard.output);
  EXPECT_EQ(heard.odometry.size(), 1U);
  player.advance(kStart_ns + 3 * kSecond_ns + 1, heard.output);
  EXPECT_EQ(heard.odometry.size(), 4U);
  EXPECT_NEAR(player.info().played_s, 3.0, 1e-6);
}

TEST(LogPlayer, ComesToItsEndWhenCalledWhenDue) {
  LogPlayer player(drive(10), {"a.log", 7.0, kStart_ns});
  Heard heard;
  int calls = 0;
  while (!player.info().ended) {
    ASSERT_LT(++calls, 20);
    player.advance(player.next_due_ns(), heard.output);
  }
  EXPECT_EQ(heard.odometry.size(), 11U);
  EXPECT_EQ(heard.scans.size(), 1U);
  EXPECT_EQ(player.next_due_ns(), std::numeric_limits<std::int64_t>::max());
}

TEST(LogPlayer, CommandsSetSpeedAndHold) {
  LogPlayer player(drive(10), {"a.log", 1.0, kStart_ns});
  Heard heard;
  DriveCommand command;
  command.stamp.number = 5;
  command.speed = 4.0;
  player.handle(command, kStart_ns + kSecond_ns);
  player.advance(kStart_ns + 2 * kSecond_ns + 10, heard.output);
  EXPECT_NEAR(player.info().played_s, 5.0, 1e-6);
  EXPECT_EQ(heard.odometry.back().answers.number, 5U);
  command.paused = true;
  player.handle(command, kStart_ns + 2 * kSecond_ns);
  player.advance(kStart_ns + 100 * kSecond_ns, heard.output);
  EXPECT_NEAR(player.info().played_s, 5.0, 1e-6);
  EXPECT_EQ(player.next_due_ns(), std::numeric_limits<std::int64_t>::max());
}

TEST(LogPlayer, SpeedsOutsideTheLimitsAreBrought) {
  LogPlayer player(drive(1), {"a.log", 1.0, kStart_ns});
  DriveCommand command;
  command.speed = 0.0;
  player.handle(command, kStart_ns);
  EXPECT_EQ(player.info().speed, kPlaySpeedMin);
  command.speed = 1e9;
  player.handle(command, kStart_ns);
  EXPECT_EQ(player.info().speed, kPlaySpeedMax);
}

TEST(LogPlayer, TellsTheSpeedOfTheRobot) {
  RobotLog log;
  for (int step = 0; step < 20; ++step) {
    LogRecord record;
    record.due_s = step * 0.1;
    record.pose.x_m = step * 0.05;
    log.records.push_back(record);
  }
  LogPlayer player(log, {"a.log", 1.0, kStart_ns});
  Heard heard;
  player.advance(kStart_ns + 3 * kSecond_ns, heard.output);
  EXPECT_NEAR(heard.odometry.back().twist.linear_mps, 0.5, 1e-9);
}

TEST(LogPlayer, BeamsLieEvenlyAroundTheHeading) {
  LogPlayer player(drive(0), {"a.log", 1.0, kStart_ns});
  Heard heard;
  player.advance(kStart_ns, heard.output);
  ASSERT_EQ(heard.scans.size(), 1U);
  EXPECT_NEAR(heard.scans[0].first_bearing_rad, -std::numbers::pi / 2, 1e-9);
  EXPECT_NEAR(heard.scans[0].bearing_step_rad, std::numbers::pi / 2, 1e-9);
}

}  // namespace
}  // namespace gimnet::demo
