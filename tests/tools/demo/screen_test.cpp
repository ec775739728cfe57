#include "tools/demo/screen.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/tools/demo/screen_support.hpp"

namespace gimnet::demo {
namespace {

using testing::HasSubstr;
using testing::Not;

std::string screen(const Monitor& monitor, const ScreenState& state, Extent extent) {
  return lines_of(draw_screen(monitor, state, extent));
}

ScreenState state() {
  ScreenState state;
  state.hub_url = "tcp://127.0.0.1:41233";
  state.now_ns = 65'000'000'000;
  return state;
}

TEST(Screen, FillsAClassicTerminal) {
  const std::string text = screen(busy_monitor(), state(), {80, 24});
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 24);
  for (const char* expected :
       {"GIMnet", "simulation", "tcp://127.0.0.1:41233", "1:05", "ROBOT", "W A S D drive", "m─"}) {
    EXPECT_THAT(text, HasSubstr(expected));
  }
}

TEST(Screen, ANarrowOneHasTheFiguresBelow) {
  const std::string text = screen(busy_monitor(), state(), {40, 14});
  EXPECT_THAT(text, Not(HasSubstr("ROBOT")));
  EXPECT_THAT(text, HasSubstr("hub: 12,345 delivered"));
}

TEST(Screen, ATinyOneSaysWhatItNeeds) {
  EXPECT_THAT(screen(busy_monitor(), state(), {23, 6}), HasSubstr("needs 24 x 6"));
  EXPECT_THAT(screen(busy_monitor(), state(), {24, 6}), Not(HasSubstr("needs")));
}

TEST(Screen, EveryExtentCanBeDrawn) {
  const Monitor monitor = busy_monitor();
  ScreenState with_help = state();
  with_help.help = true;
  for (int columns = 0; columns < 90; columns += 7) {
    for (int rows = 0; rows < 30; rows += 3) {
      const Canvas canvas = draw_screen(monitor, with_help, {columns, rows});
      EXPECT_EQ(canvas.extent(), (Extent{columns, rows}));
      if (columns < kScreenLeast.columns || rows < kScreenLeast.rows) continue;
      EXPECT_THAT(lines_of(canvas), HasSubstr("GIMnet")) << columns << " x " << rows;
      EXPECT_EQ(canvas.at({0, 1}).code, U'╭') << columns << " x " << rows;
    }
  }
}

TEST(Screen, ALogShowsItsProgressAndItsKeys) {
  Monitor monitor(0);
  RobotInfo info;
  info.source = "intel.log.gz";
  info.note = "a note";
  info.played_s = 65;
  info.duration_s = 130;
  info.speed = 2.0;
  monitor.take(info, 0);
  ScreenState early = state();
  early.now_ns = 1'000'000'000;
  const std::string text = screen(monitor, early, {80, 24});
  for (const char* expected : {"intel.log.gz", "▶ 1:05 / 2:10 ×2", "a note", "[ ] speed"}) {
    EXPECT_THAT(text, HasSubstr(expected));
  }
  EXPECT_THAT(screen(monitor, state(), {80, 24}), Not(HasSubstr("a note")));
}

TEST(Screen, SaysThatTheHubIsGone) {
  ScreenState gone = state();
  gone.connected = false;
  EXPECT_THAT(screen(busy_monitor(), gone, {80, 24}), HasSubstr("not connected"));
}

TEST(Screen, HelpLiesOverTheMap) {
  ScreenState with_help = state();
  with_help.help = true;
  EXPECT_THAT(screen(busy_monitor(), with_help, {80, 24}), HasSubstr("Ctrl-L"));
}

}  // namespace
}  // namespace gimnet::demo
