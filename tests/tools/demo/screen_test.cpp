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

TEST(Screen, AllKeysFitAClassicTerminal) {
  const std::string text = screen(busy_monitor(), state(), {80, 24});
  EXPECT_THAT(
      text,
      HasSubstr("W A S D drive  space stop  Q quit  ? help  P auto  F follow  + - zoom  T trail"));
  const std::string narrow = screen(busy_monitor(), state(), {50, 24});
  EXPECT_THAT(narrow, HasSubstr("? help")) << "it is not the first that goes";
}

TEST(Screen, ShowsBothLaboratoriesAndTheWan) {
  ScreenState labs = state();
  labs.labs = {{{"rover-1", 40.0, 0, 0}, {"crawler-1", 0.0, 57, 57}},
               {{"simulator", 39.5, 3, 3}},
               LabsView::Wan::cut,
               "CUT for 0.7 s",
               2};
  const std::string text = screen(busy_monitor(), labs, {80, 24});
  for (const char* part :
       {"NORTH", "rover-1", "crawler-1    0.0       57", "WAN         CUT for 0.7 s", "SOUTH",
        "simulator   39.5        3", "ROBOT", "HUB"})
    EXPECT_THAT(text, HasSubstr(part));
  EXPECT_THAT(screen(busy_monitor(), labs, {50, 24}), HasSubstr("WAN CUT for 0.7 s"));
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

namespace {

constexpr Extent kExtent{40, 20};

Monitor in_the_hall() {
  Monitor monitor(0);
  RobotInfo info;
  info.map = WorldMap::hall().text();
  monitor.take(info, 0);
  Odometry odometry;
  odometry.stamp.number = 1;
  odometry.pose = {4.0, 5.0, 0.0};
  monitor.take(odometry, 0);
  return monitor;
}

std::size_t glyphs_with(const Canvas& canvas, Ink ink) {
  std::size_t count = 0;
  for (int row = 0; row < canvas.extent().rows; ++row) {
    for (int column = 0; column < canvas.extent().columns; ++column) {
      const Glyph& glyph = canvas.at({column, row});
      if (glyph.ink == ink && glyph.code != U' ') ++count;
    }
  }
  return count;
}

Canvas drawn(const Monitor& monitor, const MapChoice& choice) {
  Plot plot(kExtent, choose_view(monitor, choice, kExtent));
  draw_map(plot, monitor, choice);
  Canvas canvas(kExtent);
  plot.draw(canvas, {0, 0});
  return canvas;
}

TEST(MapView, ShowsTheWholeHall) {
  const View view = choose_view(in_the_hall(), MapChoice{}, kExtent);
  EXPECT_EQ(view.centre.x_m, 9.0);
  EXPECT_EQ(view.centre.y_m, 6.0);
}

TEST(MapView, FollowsAndZoomsAroundTheRobot) {
  MapChoice choice;
  choice.follow = true;
  EXPECT_EQ(choose_view(in_the_hall(), choice, kExtent).centre.x_m, 4.0);
  choice.follow = false;
  choice.zoom = 2.0;
  const View near = choose_view(in_the_hall(), choice, kExtent);
  EXPECT_EQ(near.centre.y_m, 5.0);
  EXPECT_NEAR(near.metres_per_dot * 2.0,
              choose_view(in_the_hall(), MapChoice{}, kExtent).metres_per_dot, 1e-9);
}

TEST(MapView, DrawsEachLayer) {
  Monitor monitor = in_the_hall();
  Scan scan;
  scan.stamp.number = 1;
  scan.pose = {4.0, 5.0, 0.0};
  scan.range_max_m = 10.0;
  scan.ranges_m = {5.0F};
  monitor.take(scan, 0);
  Odometry odometry;
  odometry.stamp.number = 2;
  odometry.pose = {2.5, 5.0, 0.0};
  monitor.take(odometry, 0);
  const Canvas canvas = drawn(monitor, MapChoice{});
  EXPECT_GT(glyphs_with(canvas, Ink::kPlan), 50U);
  EXPECT_EQ(glyphs_with(canvas, Ink::kScan), 1U);
  EXPECT_GE(glyphs_with(canvas, Ink::kRobot), 2U);
  EXPECT_GE(glyphs_with(canvas, Ink::kTrail), 1U);
  MapChoice without_trail;
  without_trail.trail = false;
  EXPECT_EQ(glyphs_with(drawn(monitor, without_trail), Ink::kTrail), 0U);
}

TEST(MapView, ShowsSomethingBeforeAnythingCame) {
  const Monitor monitor(0);
  EXPECT_GT(choose_view(monitor, MapChoice{}, kExtent).metres_per_dot, 0.0);
  EXPECT_EQ(glyphs_with(drawn(monitor, MapChoice{}), Ink::kRobot), 0U);
}

TEST(MapView, TheScaleIsARoundLength) {
  Canvas canvas({20, 1});
  draw_scale(canvas, {0, 0}, {{}, 0.1});
  EXPECT_EQ(canvas.at({0, 0}).code, U'├');
  EXPECT_EQ(canvas.at({4, 0}).code, U'┤');
  EXPECT_EQ(canvas.at({6, 0}).code, U'1');
}

}  // namespace

}  // namespace gimnet::demo
