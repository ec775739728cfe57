#include "tools/demo/log_pacing.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

namespace gimnet::demo {
namespace {

LogRecord moving(double stamp_s, double x_m) {
  LogRecord record;
  record.stamp_s = stamp_s;
  record.pose.x_m = x_m;
  return record;
}

std::vector<double> due_times(std::vector<LogRecord> records) {
  RobotLog log;
  log.records = std::move(records);
  pace_log(log);
  std::vector<double> due;
  for (const LogRecord& record : log.records) due.push_back(record.due_s);
  return due;
}

using testing::DoubleNear;
using testing::ElementsAre;

TEST(LogPacing, FollowsTheStamps) {
  EXPECT_THAT(due_times({moving(100.0, 0), moving(100.2, 1), moving(100.7, 2)}),
              ElementsAre(DoubleNear(0.0, 1e-9), DoubleNear(0.2, 1e-9), DoubleNear(0.7, 1e-9)));
}

TEST(LogPacing, StampsThatStepBackAreDueAtOnce) {
  EXPECT_THAT(due_times({moving(1.0, 0), moving(3.0, 1), moving(2.5, 2), moving(3.5, 3)}),
              ElementsAre(0.0, 2.0, 2.0, 2.5));
}

TEST(LogPacing, RecordsWithoutAStampAreDueWithTheOneBefore) {
  EXPECT_THAT(due_times({moving(1.0, 0), moving(2.0, 1), moving(0.0, 1), moving(2.5, 2)}),
              ElementsAre(0.0, 1.0, 1.0, 1.5));
}

TEST(LogPacing, LongPausesAreCut) {
  EXPECT_THAT(due_times({moving(1.0, 0), moving(1.5, 0), moving(1000.0, 1), moving(1001.0, 2)}),
              ElementsAre(0.0, 0.5, kLongestPause_s + 0.5, kLongestPause_s + 1.5));
}

TEST(LogPacing, AStampThatFitsNeitherNeighbourIsPassedOver) {
  EXPECT_THAT(due_times({moving(1.0, 0), moving(9999.0, 1), moving(2.0, 2), moving(3.0, 3)}),
              ElementsAre(0.0, 0.0, 1.0, 2.0));
  EXPECT_THAT(due_times({moving(101.0, 0), moving(1e-42, 1), moving(102.0, 2)}),
              ElementsAre(0.0, 0.0, 1.0));
  EXPECT_THAT(due_times({moving(101.0, 0), moving(102.0, 1), moving(2.0, 2)}),
              ElementsAre(0.0, 1.0, 1.0));
}

TEST(LogPacing, AnotherClockIsFollowed) {
  EXPECT_THAT(due_times({moving(101.0, 0), moving(102.0, 1), moving(2.0, 2), moving(2.5, 3)}),
              ElementsAre(0.0, 1.0, 1.0, 1.5));
}

TEST(LogPacing, LeavesOutTheStandingStillBefore) {
  RobotLog log;
  for (int step = 0; step < 100; ++step)
    log.records.push_back(moving(1.0 + step * 0.1, step < 90 ? 0.0 : step));
  pace_log(log);
  EXPECT_EQ(log.records.size(), 20U);
  EXPECT_NEAR(log.records.front().due_s, 0.0, 0.11);
  EXPECT_NEAR(log.duration_s(), 1.9, 0.11);
  EXPECT_THAT(log.pacing_note, testing::HasSubstr("left out the first 8 s"));
}

TEST(LogPacing, WithoutUsableStampsTheWayPaces) {
  RobotLog log;
  for (int step = 0; step < 10; ++step) log.records.push_back(moving(1.13486e9, step * 0.25));
  pace_log(log);
  EXPECT_NEAR(log.records[1].due_s, 0.5, 1e-9);
  EXPECT_NEAR(log.duration_s(), 4.5, 1e-9);
  EXPECT_THAT(log.pacing_note, testing::HasSubstr("rounded"));
}

TEST(LogPacing, NothingIsEverDueBeforeWhatStandsBeforeIt) {
  const std::vector<double> due = due_times(
      {moving(5, 0), moving(4, 1), moving(0, 2), moving(500, 3), moving(1, 4), moving(7, 5)});
  EXPECT_TRUE(std::is_sorted(due.begin(), due.end()));
}

}  // namespace
}  // namespace gimnet::demo
