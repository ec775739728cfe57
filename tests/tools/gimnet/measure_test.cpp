#include "tools/gimnet/measure.hpp"

#include <gtest/gtest.h>

namespace gimnet::tool {
namespace {

constexpr std::int64_t kMs = 1'000'000;
constexpr std::int64_t kSecond = 1000 * kMs;

TEST(MeterStatistics, OfNothingAreZero) {
  const MeterStatistics none;
  EXPECT_EQ(none.count(), 0u);
  EXPECT_EQ(none.mean(), 0.0);
  EXPECT_EQ(none.deviation(), 0.0);
}

TEST(MeterStatistics, KeepsLeastMostMeanAndDeviation) {
  MeterStatistics values;
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
  const MeterReading reading = meter.recent(2 * kSecond);
  EXPECT_EQ(reading.rate_hz(), 0.0);
  EXPECT_EQ(reading.bytes_per_s(), 0.0);
  EXPECT_EQ(reading.seconds, 2.0);
  EXPECT_EQ(reading.silent_s, 2.0);
}

TEST(Meter, MeasuresTheRateByTheGaps) {
  Meter meter(0, 5 * kSecond);
  for (std::int64_t ms = 100; ms <= 1100; ms += 25) meter.add(ms * kMs, 10);
  const MeterReading reading = meter.recent(1110 * kMs);
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
  const MeterReading recent = meter.recent(3000 * kMs);
  EXPECT_EQ(recent.sizes_bytes.count(), 2u);
  EXPECT_DOUBLE_EQ(recent.bytes_per_s(), 40.0);
  EXPECT_DOUBLE_EQ(recent.gaps_ms.max(), 1900.0) << "a gap counts where it ends";
  const MeterReading whole = meter.whole(3000 * kMs);
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
