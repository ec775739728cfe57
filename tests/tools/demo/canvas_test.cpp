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
}  // namespace gimnet::demo
