#include "tools/demo/text_format.hpp"

#include <gtest/gtest.h>

namespace gimnet::demo {
namespace {

TEST(TextFormat, Durations) {
  EXPECT_EQ(duration_text(std::nullopt), "–");
  EXPECT_EQ(duration_text(0), "0 µs");
  EXPECT_EQ(duration_text(85'400), "85 µs");
  EXPECT_EQ(duration_text(999'499), "999 µs");
  EXPECT_EQ(duration_text(999'500), "1.00 ms");
  EXPECT_EQ(duration_text(1'240'000), "1.24 ms");
  EXPECT_EQ(duration_text(25'130'000), "25.1 ms");
  EXPECT_EQ(duration_text(340'000'000), "340 ms");
  EXPECT_EQ(duration_text(2'100'000'000), "2.10 s");
}

TEST(TextFormat, Counts) {
  EXPECT_EQ(count_text(0), "0");
  EXPECT_EQ(count_text(999), "999");
  EXPECT_EQ(count_text(1000), "1,000");
  EXPECT_EQ(count_text(18'446'744'073'709'551'615U), "18,446,744,073,709,551,615");
}

TEST(TextFormat, Clocks) {
  EXPECT_EQ(clock_text(-1), "0:00");
  EXPECT_EQ(clock_text(61.9), "1:01");
  EXPECT_EQ(clock_text(3599), "59:59");
  EXPECT_EQ(clock_text(3600), "1:00:00");
}

}  // namespace
}  // namespace gimnet::demo
