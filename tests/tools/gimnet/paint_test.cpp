#include "tools/gimnet/paint.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

namespace gimnet::tool {
namespace {

TEST(Paint, ColoursWhatIsNotPlain) {
  EXPECT_EQ(Paint(true)("x", Tone::bad), "\x1b[31mx\x1b[0m");
  EXPECT_EQ(Paint(true)("x", Tone::plain), "x");
  EXPECT_EQ(Paint(false)("x", Tone::bad), "x");
}

TEST(Paint, IsForTerminalsUnlessTheOptionSaysMore) {
  const int file = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
  ASSERT_GE(file, 0);
  EXPECT_FALSE(Paint::of(Colour::automatic, file).on());
  EXPECT_TRUE(Paint::of(Colour::always, file).on());
  EXPECT_FALSE(Paint::of(Colour::never, file).on());
  ::close(file);
}

TEST(Paint, NoColorTurnsItOffAtATerminal) {
  const int terminal = ::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
  ASSERT_GE(terminal, 0);
  ::setenv("TERM", "xterm", 1);
  ::unsetenv("NO_COLOR");
  EXPECT_TRUE(Paint::of(Colour::automatic, terminal).on());
  ::setenv("NO_COLOR", "", 1);
  EXPECT_TRUE(Paint::of(Colour::automatic, terminal).on()) << "empty is as good as not set";
  ::setenv("NO_COLOR", "1", 1);
  EXPECT_FALSE(Paint::of(Colour::automatic, terminal).on());
  ::unsetenv("NO_COLOR");
  ::setenv("TERM", "dumb", 1);
  EXPECT_FALSE(Paint::of(Colour::automatic, terminal).on());
  ::close(terminal);
}

TEST(Printable, HidesControlCharacters) {
  EXPECT_EQ(printable("a\x1b[2J\n\x7f"
                      "b\xc3\xa9"),
            "a.[2J..b\xc3\xa9");
  // C1, then what turns the direction, and ends of lines.
  EXPECT_EQ(printable("\u009b2J"), ".2J");
  EXPECT_EQ(printable("a\u202eb\u2066c\u2069\u200e\u200f\u061c\u2028"), "a.b.c.....");
  // Their neighbours are letters and spaces, and what is cut off is left as it is.
  for (const char* text : {"\u00a0", "\u061b", "\u200d", "\u2010", "\u2027", "\u202f", "\u2065",
                           "\u206a", "\xe2\x80", "\xc2"}) {
    EXPECT_EQ(printable(text), text);
  }
}

}  // namespace
}  // namespace gimnet::tool
