#include "impair/impairment.hpp"

#include <gtest/gtest.h>

namespace gimnet::impair {
namespace {

constexpr std::int64_t kMs = 1'000'000;

TEST(Impairment, TakesTimes) {
  EXPECT_EQ(*parse_duration("80ms"), 80 * kMs);
  EXPECT_EQ(*parse_duration("1.5s"), 1500 * kMs);
  EXPECT_EQ(*parse_duration("250us"), kMs / 4);
  EXPECT_EQ(*parse_duration("60min"), 3'600'000 * kMs);
  EXPECT_EQ(*parse_duration("off"), 0);
  EXPECT_EQ(*parse_duration("0"), 0);
}

TEST(Impairment, TakesBytes) {
  EXPECT_EQ(*parse_bytes("7"), 7u);
  EXPECT_EQ(*parse_bytes("1MB"), 1'000'000u);
  EXPECT_EQ(*parse_bytes("1.5MB/s"), 1'500'000u);
  EXPECT_EQ(*parse_bytes("64KiB"), 65536u);
  EXPECT_EQ(*parse_bytes("1000GB"), 1'000'000'000'000u);
}

TEST(Impairment, NamesWhatIsNoTimeOrSize) {
  for (const char* word : {"", "80", "ms", "-1ms", "80 ms", "61min", "nan", "inf", "1e300s"}) {
    const auto parsed = parse_duration(word);
    ASSERT_FALSE(parsed) << word;
    EXPECT_NE(parsed.error().sentence.find("'" + std::string(word) + "' is no time"),
              std::string::npos);
  }
  for (const char* word : {"", "MB", "-1", "1Mbit", "1001GB", "x7"})
    EXPECT_FALSE(parse_bytes(word)) << word;
}

TEST(Impairment, ChangesOneSetting) {
  const auto changed = change_setting({}, "rate", "1MB");
  ASSERT_TRUE(changed);
  EXPECT_EQ(*changed, Impairment{.rate = 1'000'000});
  EXPECT_EQ(*change_setting(*changed, "stall-for", "2s"),
            (Impairment{.rate = 1'000'000, .stall_for_ns = 2000 * kMs}));
  EXPECT_EQ(change_setting({}, "colour", "1").error().sentence,
            "there is no setting 'colour': give " + std::string(kSettingNames));
}

TEST(Impairment, AnUnboundedLineHoldsMuchAndASlowOneWhatPassesInItsDelay) {
  EXPECT_EQ(Impairment{}.queue_bytes(), std::uint64_t{16} << 20);
  EXPECT_EQ((Impairment{.delay_ns = 900 * kMs, .rate = 1'000'000}.queue_bytes()), 1'000'000u);
  EXPECT_EQ((Impairment{.rate = 1000}.queue_bytes()), std::uint64_t{64} << 10);
  EXPECT_EQ((Impairment{.rate = 1000, .queue = 10}.queue_bytes()), 10u);
}

}  // namespace
}  // namespace gimnet::impair
