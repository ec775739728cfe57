#include "tools/demo/ansi_writer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace gimnet::demo {
namespace {

using testing::HasSubstr;
using testing::Not;

constexpr TerminalStyle kColourless{true, ColourDepth::kNone};
constexpr TerminalStyle kAscii{false, ColourDepth::kNone};

Canvas with(std::string_view text, Ink ink) {
  Canvas canvas({6, 2});
  canvas.text({1, 1}, text, ink);
  return canvas;
}

TEST(AnsiWriter, DrawsEverythingAtFirst) {
  AnsiWriter writer(kColourless);
  const std::string out = writer.update(with("ab", Ink::kPlain));
  EXPECT_THAT(out, HasSubstr("\x1b[2J"));
  EXPECT_THAT(out, HasSubstr(" ab   "));
}

TEST(AnsiWriter, ThenOnlyWhatChanged) {
  AnsiWriter writer(kColourless);
  (void)writer.update(with("ab", Ink::kPlain));
  EXPECT_EQ(writer.update(with("ab", Ink::kPlain)), "");
  EXPECT_EQ(writer.update(with("ax", Ink::kPlain)), "\x1b[2;3H\x1b[0mx\x1b[0m");
}

TEST(AnsiWriter, DrawsEverythingAgainWhenAskedOrResized) {
  AnsiWriter writer(kColourless);
  (void)writer.update(with("ab", Ink::kPlain));
  writer.redraw();
  EXPECT_THAT(writer.update(with("ab", Ink::kPlain)), HasSubstr("\x1b[2J"));
  EXPECT_THAT(writer.update(Canvas({3, 3})), HasSubstr("\x1b[2J"));
}

TEST(AnsiWriter, UsesTheColoursThereAre) {
  const Canvas canvas = with("x", Ink::kScan);
  EXPECT_THAT(AnsiWriter({true, ColourDepth::k256}).update(canvas), HasSubstr("38;5;121"));
  EXPECT_THAT(AnsiWriter({true, ColourDepth::k16}).update(canvas), HasSubstr("\x1b[0;92m"));
  const std::string plain = AnsiWriter(kColourless).update(canvas);
  for (const char* colour : {"38;5", "48;5", "[0;9", "[0;3"})
    EXPECT_THAT(plain, Not(HasSubstr(colour)));
}

TEST(AnsiWriter, LinesHaveNoCursorMovementsAndNoTrailingBlanks) {
  EXPECT_EQ(AnsiWriter(kColourless).lines(with("ab", Ink::kBad)), "\n ab\n");
}

TEST(AnsiWriter, WithoutUtf8EverythingIsAscii) {
  EXPECT_EQ(AnsiWriter(kAscii).lines(with("─µ←×", Ink::kPlain)), "\n -u<x\n");
}

TEST(AsciiFor, DotsBecomeWhatTheirInkDraws) {
  EXPECT_EQ(ascii_for({U'\u2801', Ink::kRobot}), 'O');
  EXPECT_EQ(ascii_for({U'\u28FF', Ink::kScan}), '*');
  EXPECT_EQ(ascii_for({U'\u2840', Ink::kTrail}), '.');
  EXPECT_EQ(ascii_for({U'\u2840', Ink::kWall}), '#');
  EXPECT_EQ(ascii_for({U'\u2800', Ink::kWall}), ' ');
  EXPECT_EQ(ascii_for({U'\u4E2D', Ink::kPlain}), '?');
}

}  // namespace
}  // namespace gimnet::demo
