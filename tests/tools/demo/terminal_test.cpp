#include "tools/demo/terminal.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdlib>

namespace gimnet::demo {
namespace {

using testing::HasSubstr;

// A terminal without glass: what is shown comes out of `master`, what is written there was typed.
class TerminalTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(::setenv("TERM", "xterm-256color", 1), 0);
    master_ = ::posix_openpt(O_RDWR | O_NOCTTY);
    ASSERT_GE(master_, 0);
    ASSERT_EQ(::grantpt(master_), 0);
    ASSERT_EQ(::unlockpt(master_), 0);
    slave_ = ::open(::ptsname(master_), O_RDWR | O_NOCTTY);
    ASSERT_GE(slave_, 0);
  }
  void TearDown() override {
    ::close(slave_);
    ::close(master_);
  }

  [[nodiscard]] std::string shown() const {
    std::string text;
    char buffer[4096];
    pollfd waiting{master_, POLLIN, 0};
    while (::poll(&waiting, 1, 0) > 0) {
      const ssize_t got = ::read(master_, buffer, sizeof buffer);
      if (got <= 0) break;
      text.append(buffer, static_cast<std::size_t>(got));
    }
    return text;
  }
  void type(std::string_view text) const {
    ASSERT_EQ(::write(master_, text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  [[nodiscard]] std::unique_ptr<Terminal> open() const { return Terminal::open({slave_, slave_}); }
  [[nodiscard]] tcflag_t local_modes() const {
    termios modes{};
    EXPECT_EQ(::tcgetattr(slave_, &modes), 0);
    return modes.c_lflag;
  }

  int master_ = -1;
  int slave_ = -1;
};

TEST_F(TerminalTest, IsTakenOverAndGivenBack) {
  const tcflag_t before = local_modes();
  std::unique_ptr<Terminal> terminal = open();
  ASSERT_NE(terminal, nullptr);
  EXPECT_EQ(local_modes() & (ICANON | ECHO | ISIG), 0U);
  EXPECT_THAT(shown(), HasSubstr("\x1b[?1049h"));
  terminal.reset();
  EXPECT_EQ(local_modes(), before);
  EXPECT_THAT(shown(), HasSubstr("\x1b[?1049l"));
}

TEST_F(TerminalTest, GivesKeysAtOnceAndNeverWaits) {
  const std::unique_ptr<Terminal> terminal = open();
  std::string bytes = "old";
  EXPECT_TRUE(terminal->read(bytes));
  EXPECT_EQ(bytes, "");
  type("w\x03");
  while (bytes.size() < 2) {
    std::string more;
    ASSERT_TRUE(terminal->read(more));
    bytes += more;
  }
  EXPECT_EQ(bytes, "w\x03");
}

TEST_F(TerminalTest, KnowsItsExtent) {
  const std::unique_ptr<Terminal> terminal = open();
  EXPECT_EQ(terminal->extent(), (Extent{80, 24}));
  winsize size{};
  size.ws_col = 132;
  size.ws_row = 43;
  ASSERT_EQ(::ioctl(slave_, TIOCSWINSZ, &size), 0);
  EXPECT_EQ(terminal->extent(), (Extent{132, 43}));
}

TEST_F(TerminalTest, IsNotTakenWhereItCanDoNothing) {
  ASSERT_EQ(::setenv("TERM", "dumb", 1), 0);
  EXPECT_EQ(open(), nullptr);
  ASSERT_EQ(::setenv("TERM", "xterm", 1), 0);
  int pipe_ends[2];
  ASSERT_EQ(::pipe(pipe_ends), 0);
  EXPECT_EQ(Terminal::open({pipe_ends[0], pipe_ends[1]}), nullptr);
  ::close(pipe_ends[0]);
  ::close(pipe_ends[1]);
}

TEST(Environment, TellsTheColours) {
  ::unsetenv("NO_COLOR");
  ::unsetenv("COLORTERM");
  ::setenv("TERM", "xterm-256color", 1);
  EXPECT_EQ(colours_of_environment(), ColourDepth::k256);
  ::setenv("NO_COLOR", "1", 1);
  EXPECT_EQ(colours_of_environment(), ColourDepth::kNone);
  ::setenv("NO_COLOR", "", 1);
  ::setenv("TERM", "screen", 1);
  EXPECT_EQ(colours_of_environment(), ColourDepth::k16);
  ::setenv("COLORTERM", "truecolor", 1);
  EXPECT_EQ(colours_of_environment(), ColourDepth::k256);
  ::setenv("TERM", "dumb", 1);
  EXPECT_EQ(colours_of_environment(), ColourDepth::kNone);
}

TEST(Environment, TellsTheEncodingIfItKnows) {
  ::setenv("TERM", "xterm", 1);
  ::unsetenv("LC_ALL");
  ::unsetenv("LC_CTYPE");
  ::setenv("LANG", "en_GB.UTF-8", 1);
  EXPECT_EQ(utf8_of_environment(), true);
  ::setenv("LC_ALL", "de_DE.ISO-8859-1", 1);
  EXPECT_EQ(utf8_of_environment(), false);
  ::setenv("LC_ALL", "C.utf8", 1);
  EXPECT_EQ(utf8_of_environment(), true);
  ::setenv("LC_ALL", "C", 1);
  EXPECT_EQ(utf8_of_environment(), std::nullopt);
  ::unsetenv("LC_ALL");
  ::unsetenv("LANG");
  EXPECT_EQ(utf8_of_environment(), std::nullopt);
}

}  // namespace

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
