#include "tools/demo/carmen_log.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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
  EXPECT_THAT(complaint("ODOM 1 2 3 0 0 0 4 host 4 5"), HasSubstr("more than"));
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
}  // namespace gimnet::demo
