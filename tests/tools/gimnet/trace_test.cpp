#include "tools/gimnet/trace.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace gimnet::tool {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

/// An answer from a node of hub 9 over hub 8 to one of hub 7. The clock of hub 8 is 1 ms ahead of
/// that of hub 7, and the clock of hub 9 is 2 ms behind that of hub 8.
TracedPing some_ping() {
  return {900'000,
          {{9, -1'000'000, -970'000},  // 30 us in hub 9; 40 us on the link
           {8, 1'070'000, 1'090'000},  // 20 us in hub 8; 50 us on the link
           {7, 140'000, 150'000}}};    // 10 us in hub 7
}

const ClockOffsets kClocks{{{7, 8}, {1'000'000, 5'000}}, {{8, 9}, {-2'000'000, 7'000}}};

TEST(TraceTally, ListsTheHubsFromThisNodeOn) {
  TraceTally tally;
  tally.add(some_ping());
  EXPECT_THAT(tally.hubs(), ElementsAre(7, 8, 9));
  const auto hops = tally.hops(kClocks);
  ASSERT_THAT(hops, SizeIs(3));
  EXPECT_EQ(hops[0].hub_id, 7u);
  EXPECT_EQ(hops[0].delay_us.p50, 10.0);
  EXPECT_EQ(hops[1].delay_us.p50, 20.0);
  EXPECT_EQ(hops[2].delay_us.p99, 30.0);
}

TEST(TraceTally, TakesTheClocksOutOfTheLinks) {
  TraceTally tally;
  tally.add(some_ping());
  const auto hops = tally.hops(kClocks);
  EXPECT_TRUE(std::isnan(hops[0].link_us.p50));
  EXPECT_EQ(hops[1].link_us.p50, 50.0);
  EXPECT_EQ(hops[2].link_us.p50, 40.0);
  EXPECT_EQ(hops[0].clock_offset_us, 0.0);
  EXPECT_EQ(hops[1].clock_offset_us, 1'000.0);
  EXPECT_EQ(hops[2].clock_offset_us, -1'000.0);
  EXPECT_EQ(hops[2].clock_error_us, 12.0) << "the bounds are added";
}

TEST(TraceTally, BehindAnUnknownClockNothingIsKnown) {
  TraceTally tally;
  tally.add(some_ping());
  const auto hops = tally.hops({{{8, 9}, {-2'000'000, 7'000}}});
  EXPECT_TRUE(std::isnan(hops[1].clock_offset_us));
  EXPECT_TRUE(std::isnan(hops[1].link_us.p50));
  EXPECT_TRUE(std::isnan(hops[2].clock_offset_us));
  EXPECT_EQ(hops[2].link_us.p50, 40.0) << "its two ends know each other";
}

TEST(TraceTally, AnAnswerWithoutATraceIsARoundTrip) {
  TraceTally tally;
  tally.add({5'000, {}});
  EXPECT_EQ(tally.round_trips().count(), 1u);
  EXPECT_THAT(tally.hops({}), SizeIs(0));
}

TEST(TraceText, HasTheHops) {
  TraceTally tally;
  tally.add({5'000, {{7, 100'000, 110'000}}});
  EXPECT_EQ(json_of(tally.hops({}), tally.round_trips(), 2),
            "{\"hops\":[{\"hub\":7,\"delay_us\":{\"p50\":10.000,\"p99\":10.000},\"link_us\":{"
            "\"p50\":null,\"p99\":null},\"clock_offset_us\":0.000,\"clock_error_us\":0.000}],"
            "\"round_trip_us\":{\"p50\":5.000,\"p99\":5.000},\"sent\":2,\"lost\":1}\n");
  EXPECT_THAT(text_of(tally.hops({})), HasSubstr("HUB  DELAY p50 us"));
  TraceTally quick;
  quick.add({5'000, {{7, 100'000, 100'000}}});
  EXPECT_THAT(text_of(quick.hops({})), HasSubstr("7    <turn"));
}

}  // namespace
}  // namespace gimnet::tool
