#include "tools/demo/carmen_log.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "tests/tools/demo/temporary_file.hpp"

namespace gimnet::demo {
namespace {

using testing::HasSubstr;

constexpr std::string_view kOdom = "ODOM 1.5 -2.25 0.5 0 0 0 12.75 pippo 12.75";
constexpr std::string_view kScan = "FLASER 3 1.5 2 81.91 1 2 0.25 1.5 2.5 0.75 33.5 pippo 33.5";

std::string complaint(std::string_view line) {
  LogRecord record;
  const Result<LineKind> kind = parse_carmen_line(line, record);
  return kind ? "none" : kind.error().sentence;
}

TEST(CarmenLine, ReadsOdometry) {
  LogRecord record;
  ASSERT_EQ(parse_carmen_line(kOdom, record).value(), LineKind::kOdometry);
  EXPECT_EQ(record.pose.x_m, 1.5);
  EXPECT_EQ(record.pose.y_m, -2.25);
  EXPECT_EQ(record.pose.heading_rad, 0.5);
  EXPECT_EQ(record.stamp_s, 12.75);
  EXPECT_FALSE(record.is_scan());
}

TEST(CarmenLine, ReadsAScanWithThePoseOfTheLaser) {
  LogRecord record;
  ASSERT_EQ(parse_carmen_line(kScan, record).value(), LineKind::kScan);
  EXPECT_THAT(record.ranges_m, testing::ElementsAre(1.5F, 2.0F, 81.91F));
  EXPECT_EQ(record.pose.x_m, 1.0);
  EXPECT_EQ(record.pose.heading_rad, 0.25);
  EXPECT_EQ(record.stamp_s, 33.5);
}

TEST(CarmenLine, BlanksMayBeManyAndTabs) {
  LogRecord record;
  EXPECT_EQ(parse_carmen_line("  ODOM\t1  2 3 0 0 0\t4 host 4  ", record).value(),
            LineKind::kOdometry);
}

TEST(CarmenLine, PassesOverWhatIsNotItsBusiness) {
  LogRecord record;
  for (const std::string_view line :
       {"", "   ", "# comment", "#", "PARAM robot_length 0.54 1.5 b21 1.5", "NEFF 27.6",
        "RAWLASER1 1 2 3", "SYNC x"}) {
    EXPECT_EQ(parse_carmen_line(line, record).value(), LineKind::kIgnored) << line;
  }
}

TEST(CarmenLine, RefusesBrokenLinesAndSaysWhy) {
  EXPECT_THAT(complaint("ODOM 1 2 3 0 0 0 4 host"), HasSubstr("ends before logger timestamp"));
  EXPECT_THAT(complaint("ODOM"), HasSubstr("ends before x"));
  EXPECT_THAT(complaint("ODOM 1 2 3 0 0 0 4 host 4 5"), HasSubstr("more fields than"));
  EXPECT_THAT(complaint("ODOM 1 two 3 0 0 0 4 host 4"),
              HasSubstr("y is \"two\", which is no number"));
  EXPECT_THAT(complaint("ODOM 1 2x 3 0 0 0 4 host 4"), HasSubstr("no number"));
  EXPECT_THAT(complaint("ODOM nan 2 3 0 0 0 4 host 4"), HasSubstr("no number"));
  EXPECT_THAT(complaint("ODOM inf 2 3 0 0 0 4 host 4"), HasSubstr("no number"));
  EXPECT_THAT(complaint("ODOM 1e300 2 3 0 0 0 4 host 4"), HasSubstr("x is 1e+300, outside"));
  EXPECT_THAT(complaint("ODOM 1 2 3 0 0 0 -4 host 4"), HasSubstr("timestamp is -4, outside"));
  EXPECT_THAT(complaint("odom 1 2 3 0 0 0 4 host 4"), HasSubstr("no CARMEN message"));
  EXPECT_THAT(complaint("\x1f\x8b\x08 garbage"), HasSubstr("\\x1f\\x8b\\x08"));
}

TEST(CarmenLine, RefusesScansWhoseCountsDoNotFit) {
  EXPECT_THAT(complaint("FLASER 0 1 2 3 1 2 3 4 host 4"), HasSubstr("outside 1 .."));
  EXPECT_THAT(complaint("FLASER -1 1 2 3 1 2 3 4 host 4"), HasSubstr("outside 1 .."));
  EXPECT_THAT(complaint("FLASER 1.5 1 1 2 3 1 2 3 4 host 4"), HasSubstr("no number of beams"));
  EXPECT_THAT(complaint("FLASER 4 1.5 2 81.91 1 2 0.25 1.5 2.5 0.75 33.5 pippo 33.5"),
              HasSubstr("no number"));
  EXPECT_THAT(complaint("FLASER 2 1.5 -2 1 2 0.25 1.5 2.5 0.75 33.5 pippo 33.5"),
              HasSubstr("range is -2, outside"));
  EXPECT_THAT(complaint("FLASER 4294967297"), HasSubstr("outside 1 .."));
}

TEST(CarmenLine, TakesAsManyBeamsAsAllowedAndNotOneMore) {
  const auto scan_of = [](std::size_t beams) {
    std::string line = "FLASER " + std::to_string(beams);
    for (std::size_t beam = 0; beam < beams; ++beam) line += " 1";
    return line + " 1 2 3 1 2 3 4 host 4";
  };
  EXPECT_EQ(complaint(scan_of(1)), "none");
  EXPECT_EQ(complaint(scan_of(kLogBeamsMax)), "none");
  EXPECT_THAT(complaint(scan_of(kLogBeamsMax + 1)), HasSubstr("outside 1 .."));
}

TEST(RobotLog, KeepsOrderAndCounts) {
  const TemporaryFile file(
      std::string("# log\n") + std::string(kOdom) + "\n" + std::string(kScan) + "\n", true);
  const Result<RobotLog> log = load_robot_log(file.path());
  ASSERT_TRUE(log) << log.error().sentence;
  ASSERT_EQ(log->records.size(), 2U);
  EXPECT_EQ(log->scans, 1U);
  EXPECT_TRUE(log->records[1].is_scan());
  EXPECT_EQ(log->skipped, 0U);
}

TEST(RobotLog, SkipsLinesThatCannotBeReadAndNamesTheFirst) {
  const TemporaryFile file(std::string(kOdom) + "\n# fine\nODOM 1 2\n\x01\x02\n" +
                           std::string(kScan) + "\n");
  const Result<RobotLog> log = load_robot_log(file.path());
  ASSERT_TRUE(log) << log.error().sentence;
  EXPECT_EQ(log->records.size(), 2U);
  EXPECT_EQ(log->skipped, 2U);
  EXPECT_THAT(log->pacing_note, HasSubstr("skipped 2 lines that cannot be read"));
  EXPECT_EQ(log->first_skipped, file.path() + ":3: ODOM: the line ends before theta; was it cut?");
}

TEST(RobotLog, CountsALineThatIsTooLongAsOneBadLine) {
  const TemporaryFile file(std::string(kOdom) + "\n" + std::string(2U << 20, '\0') + "\n" +
                           std::string(kOdom) + "\n");
  const auto log = load_robot_log(file.path());
  ASSERT_TRUE(log.has_value());
  EXPECT_EQ(log->records.size(), 2U);
  EXPECT_EQ(log->skipped, 1U);
  EXPECT_EQ(log->first_skipped, file.path() + ":2: the line is longer than 1 MiB");
}

TEST(RobotLog, PlaysTheWholeLinesOfACutArchiveAndSaysSo) {
  std::string text;
  for (int number = 0; number < 5'000; ++number)
    text += std::string(kOdom) + "\n# " + std::to_string(number * 7919) + "\n";
  const TemporaryFile file(text, true);
  std::filesystem::resize_file(file.path(), std::filesystem::file_size(file.path()) / 2);
  const auto log = load_robot_log(file.path());
  ASSERT_TRUE(log.has_value());
  EXPECT_FALSE(log->records.empty());
  EXPECT_THAT(log->cut, testing::HasSubstr("the gzip archive ends too early; "));
  EXPECT_THAT(log->cut, testing::HasSubstr(" lines were read"));
}

TEST(RobotLog, RefusesALogInWhichNothingHappens) {
  const TemporaryFile file("# nothing\nPARAM a b\n");
  EXPECT_THAT(load_robot_log(file.path()).error().sentence,
              HasSubstr("no ODOM and no FLASER line in 2 lines"));
}

TEST(RobotLog, RefusesALogOfGarbageAndNamesItsFirstLine) {
  const TemporaryFile file("# nothing\ngarbage\n");
  EXPECT_THAT(load_robot_log(file.path()).error().sentence,
              HasSubstr("The first line that is none: " + file.path() + ":2: "));
}

}  // namespace

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

TEST(LogPacing, LongPausesAreLeftOut) {
  const double longest_s = 1.5 + kLongestPause_s;
  EXPECT_THAT(due_times({moving(1.0, 0), moving(1.5, 0), moving(longest_s, 1)}),
              ElementsAre(0.0, 0.5, kLongestPause_s + 0.5));
  EXPECT_THAT(due_times({moving(1.0, 0), moving(1.5, 0), moving(1000.0, 1), moving(1001.0, 2)}),
              ElementsAre(0.0, 0.5, 0.5, 1.5));
}

TEST(LogPacing, AStampThatFitsNeitherNeighbourTakesNoTime) {
  EXPECT_THAT(due_times({moving(1.0, 0), moving(9999.0, 1), moving(2.0, 2), moving(3.0, 3)}),
              ElementsAre(0.0, 0.0, 0.0, 1.0));
  EXPECT_THAT(due_times({moving(101.0, 0), moving(1e-42, 1), moving(102.0, 2)}),
              ElementsAre(0.0, 0.0, 0.0));
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
