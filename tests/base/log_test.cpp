#include "base/log.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>

#include "base/clock.hpp"

namespace gimnet {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class CapturedLog {
 public:
  explicit CapturedLog(LogLevel level) {
    set_log_level(level);
    ::testing::internal::CaptureStderr();
  }
  ~CapturedLog() {
    if (!read_) static_cast<void>(text());
    set_log_level(LogLevel::info);
  }
  CapturedLog(const CapturedLog&) = delete;
  CapturedLog& operator=(const CapturedLog&) = delete;
  std::string text() {
    read_ = true;
    return ::testing::internal::GetCapturedStderr();
  }

 private:
  bool read_ = false;
};

TEST(Log, WritesOneLineWithLevelAndText) {
  CapturedLog log(LogLevel::info);
  log_info("node 7.1 joined");
  const std::string text = log.text();
  EXPECT_THAT(text, ::testing::EndsWith("Z info node 7.1 joined\n"));
  EXPECT_EQ(text.size(),
            std::string_view{"2026-01-02T03:04:05.678Z info node 7.1 joined\n"}.size());
}

TEST(Log, LeavesOutWhatIsAboveItsLevel) {
  CapturedLog log(LogLevel::warning);
  log_info("not me");
  log_warning("but me");
  log_debug("nor me");
  const std::string text = log.text();
  EXPECT_THAT(text, HasSubstr("warning but me"));
  EXPECT_THAT(text, Not(HasSubstr("not me")));
  EXPECT_THAT(text, Not(HasSubstr("nor me")));
}

TEST(Log, OffSilencesErrorsToo) {
  CapturedLog log(LogLevel::off);
  log_error("anything");
  EXPECT_EQ(log.text(), "");
}

TEST(Log, EscapesWhatStrangersSend) {
  EXPECT_EQ(escaped("a\nb\x1b[2J\x7f"), "a\\x0ab\\x1b[2J\\x7f");
  EXPECT_EQ(escaped(std::string_view{"\0x\xff", 3}), "\\x00x\\xff");
  EXPECT_EQ(escaped("'quotes' and \\"), "'quotes' and \\");
}

TEST(Log, CutsLongTexts) {
  EXPECT_EQ(escaped("abcdef", 6), "abcdef");
  EXPECT_EQ(escaped("abcdefg", 6), "abcdef...");
}

TEST(Log, KnowsItsLevelsByName) {
  LogLevel level = LogLevel::info;
  EXPECT_TRUE(parse_log_level("debug", level));
  EXPECT_EQ(level, LogLevel::debug);
  EXPECT_TRUE(parse_log_level("off", level));
  EXPECT_EQ(level, LogLevel::off);
  EXPECT_FALSE(parse_log_level("Debug", level));
  EXPECT_FALSE(parse_log_level("", level));
  EXPECT_EQ(level, LogLevel::off);
}

std::size_t lines_in(const std::string& text) {
  return static_cast<std::size_t>(std::ranges::count(text, '\n'));
}

TEST(Log, WhatOnePeerCausesIsWrittenTenTimesASecondAndEscaped) {
  CapturedLog log(LogLevel::info);
  set_log_rates({1'000'000, 1});
  for (int i = 0; i < 100'000; ++i)
    log_line(LogLevel::info, {"refused", "a test's peer"}, "no\n2026 info \x1b[2J");
  log_line(LogLevel::info, {"refused", "a test's other peer"}, "yes");
  set_log_rates({});
  const std::string text = log.text();
  EXPECT_THAT(text, HasSubstr("no\\x0a2026 info \\x1b[2J\n"));
  EXPECT_THAT(text, HasSubstr(" yes"));
  // The loop may take any time. A line a second of it is written, and all the others are counted.
  EXPECT_LT(lines_in(text), 1'000u);
}

TEST(Log, APipeThatNobodyReadsHoldsNobodyUp) {
  std::array<int, 2> pipe{};
  ASSERT_EQ(::pipe(pipe.data()), 0);
  const int before = ::dup(STDERR_FILENO);
  ASSERT_EQ(::dup2(pipe[1], STDERR_FILENO), STDERR_FILENO);
  set_log_rates({1'000'000, 1});
  const std::string line(900, 'x');
  for (int i = 0; i < 1'000; ++i) log_info(line);  // a pipe has 64 KiB
  std::array<char, 65'536> memory{};
  ASSERT_GT(::read(pipe[0], memory.data(), memory.size()), 0);
  log_info("read again");
  set_log_rates({});
  ASSERT_EQ(::dup2(before, STDERR_FILENO), STDERR_FILENO);
  ::close(before);
  ::close(pipe[1]);
  std::string text;
  for (ssize_t size = 0; (size = ::read(pipe[0], memory.data(), memory.size())) > 0;) {
    text.append(memory.data(), static_cast<std::size_t>(size));
  }
  ::close(pipe[0]);
  EXPECT_THAT(
      text, ::testing::ContainsRegex("read again \\([0-9]+ lines before this were left out\\)\n"));
}

TEST(Log, WhatIsLeftOutIsCountedInTheNextLine) {
  CapturedLog log(LogLevel::info);
  set_log_rates({1, 1});
  for (int i = 0; i < 1'000; ++i) log_info("one of many");
  set_log_rates({1'000'000, 1});
  const std::int64_t before = steady_now_ns();
  while (steady_now_ns() < before + 2'000'000) {  // until there is a token again
  }
  log_info("at last");
  set_log_rates({});
  EXPECT_THAT(log.text(), ::testing::MatchesRegex(
                              "(.|\n)* at last \\([0-9]+ lines before this were left out\\)\n"));
}

}  // namespace
}  // namespace gimnet
