#include "base/log.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace gimnet {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr std::int64_t kSecond = 1'000'000'000;

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
  EXPECT_EQ(text.size(), std::string_view{"2026-01-02T03:04:05.678Z info node 7.1 joined\n"}.size());
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

TEST(LogBudget, TakesABurstAndThenARate) {
  LogBudget budget;
  int taken = 0;
  for (int i = 0; i < 300; ++i) taken += budget.take(5 * kSecond) ? 1 : 0;
  EXPECT_EQ(taken, 200);
  EXPECT_EQ(budget.left_out(), 100u);
  EXPECT_EQ(budget.left_out(), 0u);
  taken = 0;
  for (int i = 0; i < 300; ++i) taken += budget.take(6 * kSecond) ? 1 : 0;
  EXPECT_EQ(taken, 100);
}

TEST(LogBudget, StandsAClockThatGoesBack) {
  LogBudget budget;
  EXPECT_TRUE(budget.take(10 * kSecond));
  EXPECT_TRUE(budget.take(1 * kSecond));
}

}  // namespace
}  // namespace gimnet
