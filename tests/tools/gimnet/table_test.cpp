#include "tools/gimnet/table.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <limits>

namespace gimnet::tool {
namespace {

TEST(Table, HasColumnsAsWideAsTheyNeed) {
  Table table({"ID", "NAME"});
  table.add({"7.17", "robot"});
  table.add({"7.1", "a"});
  EXPECT_EQ(table.text(), "ID    NAME\n7.17  robot\n7.1   a\n");
}

TEST(Table, ColoursWholeRowsAndHidesControlCharacters) {
  Table table({"ID"});
  table.add({"a\x1b[2J"}, Tone::warning);
  EXPECT_EQ(table.text(Paint(true)), "\x1b[1mID\x1b[0m\n\x1b[33ma.[2J\x1b[0m\n");
}

}  // namespace

namespace {

TEST(Decimal, HasThePlacesThatAreWanted) {
  EXPECT_EQ(decimal(1.0 / 3.0, 3), "0.333");
  EXPECT_EQ(decimal(2.5), "2.5");
  EXPECT_EQ(decimal(10.0), "10");
  EXPECT_EQ(decimal(std::numeric_limits<double>::max(), 0).size(), 309u);
}

TEST(ByteCount, TakesTheUnitThatSuits) {
  EXPECT_EQ(byte_count(0), "0 B");
  EXPECT_EQ(byte_count(999), "999 B");
  EXPECT_EQ(byte_count(1000), "1.0 kB");
  EXPECT_EQ(byte_count(999'949), "999.9 kB");
  EXPECT_EQ(byte_count(999'960), "1.0 MB");
  EXPECT_EQ(byte_count(2.5e9), "2.5 GB");
  EXPECT_EQ(byte_count(5e15), "5000.0 TB");
}

}  // namespace

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
