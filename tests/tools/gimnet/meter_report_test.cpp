#include "tools/gimnet/meter_report.hpp"

#include <gtest/gtest.h>

namespace gimnet::tool {
namespace {

std::vector<ServiceReading> readings() {
  ServiceReading one{"robot/odom", {}, 3};
  for (const double gap : {20.0, 30.0}) one.reading.gaps_ms.add(gap);
  for (const double size : {1000.0, 2000.0, 3000.0}) one.reading.sizes_bytes.add(size);
  one.reading.seconds = 2.0;
  one.reading.silent_s = 0.01;
  return {one};
}

TEST(MeterReport, AnObjectALine) {
  EXPECT_EQ(
      json_of(readings(), Measure::rate, Span::recent),
      R"({"service":"robot/odom","whole":false,"seconds":2.000,"messages":3,"missed":3,"skipped":0,"silent_s":0.010,)"
      R"("rate_hz":40.000,"gap_min_ms":20.000,"gap_mean_ms":25.000,"gap_max_ms":30.000,"gap_std_ms":5.000})"
      "\n");
  EXPECT_EQ(
      json_of(readings(), Measure::bytes, Span::whole),
      R"({"service":"robot/odom","whole":true,"seconds":2.000,"messages":3,"missed":3,"skipped":0,"silent_s":0.010,)"
      R"("bytes_per_s":3000.000,"bytes":6000,"size_min":1000,"size_mean":2000.000,"size_max":3000})"
      "\n");
}

TEST(MeterReport, ATableForPeople) {
  EXPECT_EQ(text_of(readings(), Measure::rate, Span::whole),
            "in all 2.0 s:\n"
            "SERVICE     HZ    GAP MIN  MEAN    MAX     STD ms  MESSAGES  MISSED\n"
            "robot/odom  40.0  20.000   25.000  30.000  5.000   3         3\n");
  EXPECT_EQ(text_of(readings(), Measure::bytes, Span::recent),
            "SERVICE     BYTES/S   SIZE MIN  MEAN    MAX     SUM     MESSAGES  MISSED\n"
            "robot/odom  3.0 kB/s  1.0 kB    2.0 kB  3.0 kB  6.0 kB  3         3\n");
  EXPECT_EQ(text_of({}, Measure::rate, Span::recent), "");
}

TEST(MeterReport, AServiceThatFellSilentIsAWarning) {
  auto silent = readings();
  silent.front().reading.silent_s = 1.5;
  EXPECT_NE(text_of(silent, Measure::rate, Span::recent, Paint(true)).find("\x1b[33mrobot/odom"),
            std::string::npos);
  EXPECT_EQ(text_of(readings(), Measure::rate, Span::recent, Paint(true)).find("\x1b[33m"),
            std::string::npos);
}

TEST(MeterReport, WhatALatestServiceReplacedIsSkipped) {
  auto latest = readings();
  latest.front().latest = true;
  EXPECT_NE(text_of(latest, Measure::rate, Span::whole).find("  3 skipped\n"), std::string::npos);
  EXPECT_NE(json_of(latest, Measure::rate, Span::whole).find(R"("missed":3,"skipped":3)"),
            std::string::npos);
  latest.front().missed = 0;
  EXPECT_EQ(text_of(latest, Measure::rate, Span::whole).find("skipped"), std::string::npos);
}

TEST(MeterReport, AServiceOfWhichNothingCameHasNoGaps) {
  EXPECT_NE(text_of({{"a/b", {}, 0, false}}, Measure::rate, Span::recent).find("a/b      0.0  -"),
            std::string::npos);
}

}  // namespace
}  // namespace gimnet::tool
