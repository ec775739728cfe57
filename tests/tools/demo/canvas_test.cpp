#include "tools/demo/canvas.hpp"

#include <gtest/gtest.h>

namespace gimnet::demo {
namespace {

TEST(Canvas, WritesTextAndClipsIt) {
  Canvas canvas({4, 1});
  EXPECT_EQ(canvas.text({2, 0}, "µ°x", Ink::kGood), 5);
  EXPECT_EQ(canvas.at({2, 0}).code, U'µ');
  EXPECT_EQ(canvas.at({3, 0}).code, U'°');
  EXPECT_EQ(canvas.at({3, 0}).ink, Ink::kGood);
  canvas.text({-1, 0}, "abc", Ink::kPlain);
  EXPECT_EQ(canvas.at({0, 0}).code, U'b');
  canvas.text({0, 5}, "nowhere", Ink::kPlain);
}

TEST(Canvas, ControlCharactersDoNotReachTheTerminal) {
  Canvas canvas({3, 1});
  canvas.text({0, 0}, "\x1b\n\x7f", Ink::kPlain);
  for (int column = 0; column < 3; ++column) EXPECT_EQ(canvas.at({column, 0}).code, U'\uFFFD');
}

TEST(Canvas, TextKeepsTheGroundUnderIt) {
  Canvas canvas({3, 1});
  canvas.lay_ground({0, 0}, 9, Ground::kBar);
  canvas.text({1, 0}, "x", Ink::kTitle);
  EXPECT_EQ(canvas.at({1, 0}).ground, Ground::kBar);
}

TEST(Canvas, AbsurdExtentsAreCut) {
  EXPECT_EQ(Canvas({-5, 7}).extent(), (Extent{0, 7}));
  EXPECT_EQ(Canvas({5000, 5000}).extent(), (Extent{1000, 1000}));
}

TEST(Canvas, FramesHaveRoundCorners) {
  Canvas canvas({4, 3});
  canvas.frame({{0, 0}, {4, 3}});
  EXPECT_EQ(canvas.at({0, 0}).code, U'╭');
  EXPECT_EQ(canvas.at({3, 2}).code, U'╯');
  EXPECT_EQ(canvas.at({1, 1}).code, U' ');
}

TEST(Utf8, ComesBack) {
  for (const char32_t code :
       {U'a', U'µ', U'⣿', U'\U0001F916', U'\u07FF', U'\u0800', U'\uFFFF', U'\U00010000'}) {
    std::string text;
    append_utf8(text, code);
    EXPECT_EQ(decoded_utf8(text), std::u32string(1, code));
  }
}

TEST(Utf8, WhatIsNoneIsReplacedByteByByte) {
  EXPECT_EQ(decoded_utf8("\xff"
                         "a"),
            U"\uFFFDa");
  EXPECT_EQ(decoded_utf8("\xc3"), U"\uFFFD");
  EXPECT_EQ(decoded_utf8("\xc0\x80"), U"\uFFFD\uFFFD");
  EXPECT_EQ(decoded_utf8("\xed\xa0\x80"), U"\uFFFD\uFFFD\uFFFD");
  EXPECT_EQ(decoded_utf8("\xf4\x90\x80\x80"), U"\uFFFD\uFFFD\uFFFD\uFFFD");
  EXPECT_EQ(decoded_utf8("\xe0\x9f\xbf"), U"\uFFFD\uFFFD\uFFFD");
}

}  // namespace

namespace {

// 4 by 2 characters, 8 by 8 dots of 1 m; the origin in the middle.
constexpr Extent kExtent{4, 2};
constexpr View kView{{0.0, 0.0}, 1.0};

char32_t code_at(const Plot& plot, ScreenPlace place) {
  Canvas canvas(kExtent);
  plot.draw(canvas, {0, 0});
  return canvas.at(place).code;
}

TEST(Plot, SetsTheDotOfAPoint) {
  Plot plot(kExtent, kView);
  plot.dot({-3.5, 3.5}, Ink::kWall);
  EXPECT_EQ(code_at(plot, {0, 0}), U'\u2801');
  plot.dot({3.5, -3.5}, Ink::kWall);
  EXPECT_EQ(code_at(plot, {3, 1}), U'\u2880');
  EXPECT_EQ(code_at(plot, {1, 0}), U' ');
}

TEST(Plot, WhatLiesOutsideIsNotDrawn) {
  Plot plot(kExtent, kView);
  for (const Point& point :
       {Point{-4.5, 0}, {4.5, 0}, {0, 4.5}, {0, -4.5}, {1e300, 0}, {0, -1e300}}) {
    plot.dot(point, Ink::kWall);
    plot.ground(point, Ground::kBeam);
  }
  plot.fill({{100, 100}, {200, 200}}, Ink::kWall);
  plot.fill({{-1e300, 100}, {1e300, 200}}, Ink::kWall);
  plot.line({10, 10}, {20, 20}, Ink::kWall);
  for (int column = 0; column < 4; ++column) EXPECT_EQ(code_at(plot, {column, 0}), U' ');
}

TEST(Plot, FillsABoxOnce) {
  Plot plot(kExtent, kView);
  plot.fill({{-4, 0}, {-2, 4}}, Ink::kWall);
  EXPECT_EQ(code_at(plot, {0, 0}), U'\u28FF');
  EXPECT_EQ(code_at(plot, {1, 0}), U' ');
  EXPECT_EQ(code_at(plot, {0, 1}), U' ');
}

TEST(Plot, ABoxIsNeverNothing) {
  Plot plot(kExtent, kView);
  plot.fill({{-3.6, 3.4}, {-3.5, 3.5}}, Ink::kWall);
  EXPECT_EQ(code_at(plot, {0, 0}), U'\u2801');
}

TEST(Plot, TheHighestInkColoursAndTheRobotPushesOthersOut) {
  Plot plot(kExtent, kView);
  Canvas canvas(kExtent);
  plot.dot({-3.5, 3.5}, Ink::kScan);
  plot.dot({-2.5, 3.5}, Ink::kWall);
  plot.draw(canvas, {0, 0});
  EXPECT_EQ(canvas.at({0, 0}).code, U'\u2809');
  EXPECT_EQ(canvas.at({0, 0}).ink, Ink::kScan);
  plot.dot({-3.5, 2.5}, Ink::kRobot);
  plot.draw(canvas, {0, 0});
  EXPECT_EQ(canvas.at({0, 0}).code, U'\u2802');
  EXPECT_EQ(canvas.at({0, 0}).ink, Ink::kRobot);
}

TEST(Plot, DrawsLinesAndTriangles) {
  Plot plot(kExtent, kView);
  plot.line({-3.5, 3.5}, {3.5, 3.5}, Ink::kTrail);
  for (int column = 0; column < 4; ++column) EXPECT_EQ(code_at(plot, {column, 0}), U'\u2809');
  plot.triangle({-3.9, -3.9}, {-3.9, -0.1}, {-0.1, -3.9}, Ink::kRobot);
  EXPECT_NE(code_at(plot, {0, 1}), U' ');
  EXPECT_EQ(code_at(plot, {3, 1}), U' ');
}

TEST(Plot, FitsABoxWithAMargin) {
  const View view = Plot::fitted({{0, 0}, {16, 4}}, kExtent);
  EXPECT_EQ(view.centre.x_m, 8.0);
  EXPECT_EQ(view.centre.y_m, 2.0);
  const double shown_m = kExtent.columns * Plot::kDotColumns * view.metres_per_dot;
  EXPECT_GT(shown_m, 16.0);
  EXPECT_LT(shown_m, 18.0);
}

}  // namespace

}  // namespace gimnet::demo
