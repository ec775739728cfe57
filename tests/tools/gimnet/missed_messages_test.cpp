#include "tools/gimnet/missed_messages.hpp"

#include <gtest/gtest.h>

#include "tests/client/gimi/support/made_message.hpp"

namespace gimnet::tool {
namespace {

using test::make_message;
using Sentences = std::vector<std::string>;

class MissedMessagesTest : public testing::Test {
 protected:
  std::uint64_t take(std::uint32_t sequence) { return missed_.take(make_message("x", sequence, {}, "r/s")); }

  MissedMessages missed_;
};

TEST_F(MissedMessagesTest, TheFirstMayHaveAnyNumber) {
  EXPECT_EQ(take(1000), 0u);
  EXPECT_EQ(take(1001), 0u);
  EXPECT_EQ(missed_.rest(), Sentences{});
}

TEST_F(MissedMessagesTest, GapsAreCounted) {
  take(1);
  EXPECT_EQ(take(3), 1u);
  EXPECT_EQ(missed_.rest(), Sentences{"1 message of r/s did not come (this reader was too slow)"});
  EXPECT_EQ(take(13), 10u);
  EXPECT_EQ(missed_.rest(), Sentences{"10 messages of r/s did not come (this reader was too slow)"});
  EXPECT_EQ(missed_.rest(), Sentences{}) << "once";
}

TEST_F(MissedMessagesTest, NumbersWrapAround) {
  take(0xFFFFFFFF);
  EXPECT_EQ(take(1), 1u);
}

TEST_F(MissedMessagesTest, AProviderThatBeginsAgainMissedNothing) {
  take(500);
  EXPECT_EQ(take(1), 0u);
  EXPECT_EQ(take(2), 0u);
}

TEST_F(MissedMessagesTest, NewsComeAtMostOnceASecond) {
  take(1);
  EXPECT_EQ(missed_.news(50), Sentences{});
  take(3);
  EXPECT_EQ(missed_.news(100).size(), 1u);
  take(5);
  EXPECT_EQ(missed_.news(100 + NewsPace::kPeriodNs - 1), Sentences{});
  EXPECT_EQ(missed_.news(100 + NewsPace::kPeriodNs),
            Sentences{"2 messages of r/s did not come (this reader was too slow)"});
}

}  // namespace
}  // namespace gimnet::tool
