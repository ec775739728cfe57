#include "tools/demo/options.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

namespace gimnet::demo {
namespace {

using testing::HasSubstr;

Result<DemoOptions> parsed(const std::vector<const char*>& words) { return parse_options(words); }

std::string complaint(const std::vector<const char*>& words) {
  const Result<DemoOptions> options = parsed(words);
  return options ? "none" : options.error().sentence;
}

TEST(DemoOptions, WithoutArgumentsEverythingIsStarted) {
  const DemoOptions options = parsed({}).value();
  EXPECT_EQ(options.role, DemoRole::kAll);
  EXPECT_FALSE(options.seconds);
  EXPECT_TRUE(options.log.empty());
}

TEST(DemoOptions, TakesValuesBehindABlankOrAnEqualsSign) {
  const DemoOptions options =
      parsed({"--log", "a.log.gz", "--seconds=10", "--speed", "2.5"}).value();
  EXPECT_EQ(options.log, "a.log.gz");
  EXPECT_EQ(options.seconds, 10.0);
  EXPECT_EQ(options.speed, 2.5);
}

TEST(DemoOptions, TheRolesComeFirst) {
  EXPECT_EQ(parsed({"robot", "--hub", "unix:/x"}).value().role, DemoRole::kRobot);
  EXPECT_EQ(parsed({"view", "--robot", "r2.d-2"}).value().role, DemoRole::kView);
  EXPECT_THAT(complaint({"--seconds", "1", "robot"}), HasSubstr("no argument 'robot'"));
}

TEST(DemoOptions, SaysWhatIsWrong) {
  EXPECT_THAT(complaint({"--frobnicate"}), HasSubstr("no argument '--frobnicate'"));
  EXPECT_THAT(complaint({"--log"}), HasSubstr("needs a value"));
  EXPECT_THAT(complaint({"--log="}), HasSubstr("--log is empty"));
  EXPECT_THAT(complaint({"--log", "a", "--log", "b"}), HasSubstr("given twice"));
  EXPECT_THAT(complaint({"--ascii=yes"}), HasSubstr("takes no value"));
  EXPECT_THAT(complaint({"--robot", "a/b"}), HasSubstr("takes a name"));
}

TEST(DemoOptions, NumbersHaveBounds) {
  EXPECT_EQ(complaint({"--seconds", "0.1"}), "none");
  EXPECT_EQ(complaint({"--seconds", "86400"}), "none");
  for (const char* bad : {"0.09", "86401", "-1", "nan", "inf", "ten", "5s", ""}) {
    EXPECT_THAT(complaint({"--seconds", bad}),
                HasSubstr("--seconds takes a number from 0.1 to 86400"))
        << bad;
  }
  EXPECT_THAT(complaint({"--log", "a", "--speed", "101"}), HasSubstr("from 0.1 to 100"));
}

TEST(DemoOptions, RefusesWhatMeansNothingTogether) {
  EXPECT_THAT(complaint({"--log", "a", "--map", "b"}), HasSubstr("exclude each other"));
  EXPECT_THAT(complaint({"--speed", "2"}), HasSubstr("speed of a log"));
  EXPECT_THAT(complaint({"--hub", "unix:/x"}), HasSubstr("say 'robot' or 'view' first"));
  EXPECT_THAT(complaint({"view", "--log", "a"}), HasSubstr("is the robot's"));
  EXPECT_THAT(complaint({"robot", "--seconds", "5"}), HasSubstr("is the viewer's"));
  EXPECT_THAT(complaint({"--ascii", "--utf8"}), HasSubstr("exclude each other"));
  EXPECT_TRUE(parsed({"--labs", "--seconds", "5"}).value().labs);
  EXPECT_THAT(complaint({"--labs", "--map", "a"}), HasSubstr("brings its own machines"));
  EXPECT_THAT(complaint({"view", "--labs"}), HasSubstr("is for the whole demo"));
}

TEST(DemoOptions, HelpNeedsNothingElse) {
  EXPECT_TRUE(parsed({"--help"}).value().help);
  EXPECT_TRUE(parsed({"robot", "-h"}).value().help);
  EXPECT_THAT(std::string(usage_text()), HasSubstr("--seconds"));
}

}  // namespace
}  // namespace gimnet::demo
