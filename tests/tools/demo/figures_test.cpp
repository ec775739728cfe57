#include "tools/demo/figures.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/demo/screen_support.hpp"

namespace gimnet::demo {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(TextFormat, Durations) {
  EXPECT_EQ(duration_text(std::nullopt), "–");
  EXPECT_EQ(duration_text(0), "0 µs");
  EXPECT_EQ(duration_text(85'400), "85 µs");
  EXPECT_EQ(duration_text(999'499), "999 µs");
  EXPECT_EQ(duration_text(999'500), "1.00 ms");
  EXPECT_EQ(duration_text(1'240'000), "1.24 ms");
  EXPECT_EQ(duration_text(25'130'000), "25.1 ms");
  EXPECT_EQ(duration_text(340'000'000), "340 ms");
  EXPECT_EQ(duration_text(2'100'000'000), "2.10 s");
}

TEST(TextFormat, Counts) {
  EXPECT_EQ(count_text(0), "0");
  EXPECT_EQ(count_text(999), "999");
  EXPECT_EQ(count_text(1000), "1,000");
  EXPECT_EQ(count_text(18'446'744'073'709'551'615U), "18,446,744,073,709,551,615");
}

TEST(TextFormat, Clocks) {
  EXPECT_EQ(clock_text(-1), "0:00");
  EXPECT_EQ(clock_text(61.9), "1:01");
  EXPECT_EQ(clock_text(3599), "59:59");
  EXPECT_EQ(clock_text(3600), "1:00:00");
}

ScreenState at_one_second() {
  ScreenState state;
  state.now_ns = 1'025'000'000;
  return state;
}

std::string panel(const Monitor& monitor, const ScreenState& state, int rows) {
  Canvas canvas({27, rows});
  draw_panel(canvas, monitor, state, {{0, 0}, {27, rows}});
  return lines_of(canvas);
}

TEST(Figures, ShowRobotStreamsLatencyAndHub) {
  const std::string text = panel(busy_monitor(), at_one_second(), 22);
  for (const char* expected : {"ROBOT", "driven by you", "4.25", "5.50 m", "0.75 m/s", "← odom",
                               "40.0", "120 µs", "ledger exact", "12,345"}) {
    EXPECT_THAT(text, HasSubstr(expected));
  }
}

TEST(Figures, SayWhoDrives) {
  ScreenState state = at_one_second();
  state.autopilot = true;
  EXPECT_THAT(panel(busy_monitor(), state, 22), HasSubstr("autopilot"));
}

TEST(Figures, TellALogThatHasEndedFromOneThatWasStopped) {
  Monitor monitor = busy_monitor();
  RobotInfo info;
  info.source = "a.log";
  info.duration_s = 879.0;
  info.played_s = 10.2;
  monitor.take(info, 0);
  EXPECT_THAT(panel(monitor, at_one_second(), 22), HasSubstr("recorded"));
  info.ended = true;
  monitor.take(info, 0);
  EXPECT_THAT(panel(monitor, at_one_second(), 22), HasSubstr("stopped after 10 s"));
  info.played_s = info.duration_s;
  monitor.take(info, 0);
  EXPECT_THAT(panel(monitor, at_one_second(), 22), HasSubstr("log has ended"));
}

TEST(Figures, ShowDropsAndAnOpenLedger) {
  Monitor monitor = busy_monitor();
  HubCounters counters;
  counters.add("accepted", 10);
  counters.add("delivered", 6);
  counters.add("dropped.queue_full", 3);
  monitor.take(counters);
  EXPECT_THAT(panel(monitor, at_one_second(), 22), HasSubstr("ledger open"));
}

TEST(Figures, AreCutWhereTheAreaEnds) {
  const std::string text = panel(busy_monitor(), at_one_second(), 10);
  EXPECT_THAT(text, HasSubstr("STREAMS"));
  EXPECT_THAT(text, Not(HasSubstr("HUB")));
}

TEST(Figures, StandBeforeAnythingCame) {
  EXPECT_THAT(panel(Monitor(0), ScreenState{}, 22), HasSubstr("no counters yet"));
}

TEST(Figures, TheStripHasTheImportantOnes) {
  Canvas canvas({60, 3});
  draw_strip(canvas, busy_monitor(), at_one_second(), {{0, 0}, {60, 3}});
  EXPECT_THAT(lines_of(canvas), HasSubstr("odom 40 Hz"));
  EXPECT_THAT(lines_of(canvas), HasSubstr("12,345 delivered, 0 dropped"));
}

}  // namespace
}  // namespace gimnet::demo
