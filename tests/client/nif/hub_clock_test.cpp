#include "client/nif/hub_clock.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <thread>

namespace gimnet::nif::test {
namespace {

TEST(HubClock, TakesTheOffsetOfTheShortestRoundTrip) {
  HubClock clock;
  EXPECT_FALSE(clock.best());
  const auto first = clock.ping(1000, 5000);
  EXPECT_EQ(first.sent_ns, 5000);
  clock.on_pong({first.sequence, 5000, 5150}, 1100);  // 100 ns round trip, 100 ahead
  const auto slow = clock.ping(2000, 6000);
  clock.on_pong({slow.sequence, 6000, 6990}, 3000);
  ASSERT_TRUE(clock.best());
  EXPECT_EQ(clock.best()->offset_ns, 100);
  EXPECT_EQ(clock.best()->round_trip_ns, 1000) << "the last one";
}

TEST(HubClock, TellsTheHubsTimeByTheWelcomeAndThenByTheShortestRoundTrip) {
  HubClock clock;
  EXPECT_FALSE(clock.hub_time(1'000));
  clock.begin(50'000, 1'000);
  EXPECT_EQ(clock.hub_time(1'500), 50'500);
  const auto first = clock.ping(2'000, 9);
  clock.on_pong({first.sequence, 9, 70'050}, 2'100);
  EXPECT_EQ(clock.hub_time(3'050), 71'050);
  const auto slow = clock.ping(4'000, 2'009);
  clock.on_pong({slow.sequence, 2'009, 72'900}, 5'000);
  EXPECT_EQ(clock.hub_time(3'050), 71'050) << "a longer round trip says less";
  clock.clear();
  EXPECT_EQ(clock.hub_time(3'050), 71'050) << "it goes on while the connection is broken";
  clock.begin(10, 3'050);
  EXPECT_EQ(clock.hub_time(3'050), 10) << "another hub";
}

TEST(HubClock, TellsWhenItWasAHubsTimeAndHowWellItKnows) {
  HubClock clock;
  clock.begin(50'000, 1'000);
  EXPECT_FALSE(clock.own_time(50'000)) << "nobody knows how old the WELCOME was";
  const auto ping = clock.ping(2'000, 9);
  clock.on_pong({ping.sequence, 9, 70'050}, 2'100);
  const auto known = clock.own_time(70'000);
  ASSERT_TRUE(known);
  EXPECT_EQ(known->steady_ns, 2'000);
  EXPECT_EQ(known->error_ns, 50);
  EXPECT_TRUE(clock.own_time(INT64_MIN)) << "other nodes may say anything";
  clock.clear();
  EXPECT_FALSE(clock.own_time(70'000));
}

TEST(HubClock, FollowsAClockThatWasSet) {
  HubClock clock;
  const auto measure = [&clock](std::int64_t steady_ns, std::int64_t wall_ns, std::int64_t hub_ns,
                                std::int64_t round_trip_ns) {
    const auto ping = clock.ping(steady_ns, wall_ns);
    clock.on_pong({ping.sequence, wall_ns, hub_ns + round_trip_ns / 2}, steady_ns + round_trip_ns);
  };
  measure(1'000, 5'000, 5'000, 10);
  EXPECT_EQ(clock.hub_time(2'000), 6'000);
  measure(2'000, 6'000, 6'000 + 505, 1'000);
  EXPECT_EQ(clock.hub_time(2'000), 6'000) << "it may be the same time";
  measure(3'000, 7'000, 7'000 + 507, 1'000);
  EXPECT_EQ(clock.hub_time(3'000), 7'507) << "the hub's clock was set";
  measure(4'000, 8'000, 8'000 - 3'600, 2'000);
  EXPECT_EQ(clock.hub_time(4'000), 4'400) << "back, and by a long round trip";
  EXPECT_EQ(clock.best()->offset_ns, -3'600);
  measure(5'000, 90'000, 5'400, 1'000);
  EXPECT_EQ(clock.best()->offset_ns, 5'400 - 90'000) << "the own one was set";
}

TEST(HubClock, IgnoresWhatWasNotAskedAndRepeats) {
  HubClock clock;
  clock.on_pong({99, 0, 0}, 0);
  EXPECT_FALSE(clock.best());
  const auto ping = clock.ping(0, 0);
  clock.on_pong({ping.sequence, 0, 50}, 100);
  clock.on_pong({ping.sequence, 0, 5000}, 10'000);
  EXPECT_EQ(clock.best()->round_trip_ns, 100);
}

TEST(HubClock, StandsImpossibleTimes) {
  HubClock clock;
  for (const std::int64_t now :
       {std::numeric_limits<std::int64_t>::min(), std::numeric_limits<std::int64_t>::max()}) {
    const auto ping = clock.ping(0, -2);
    clock.on_pong({ping.sequence, 0, now}, 1);
  }
  EXPECT_TRUE(clock.best());
}

TEST(HubClock, WaitsForOneAnswer) {
  HubClock clock;
  const auto ping = clock.ping(0, 0);
  EXPECT_FALSE(clock.wait_for(ping.sequence, 0));
  std::thread waiting([&] { EXPECT_EQ(clock.wait_for(ping.sequence, kNever)->round_trip_ns, 7); });
  clock.on_pong({ping.sequence, 0, 0}, 7);
  waiting.join();
  const auto lost = clock.ping(0, 0);
  std::thread broken([&] { EXPECT_FALSE(clock.wait_for(lost.sequence, kNever)); });
  clock.clear();
  broken.join();
}

TEST(HubClock, RemembersABoundedNumber) {
  HubClock clock;
  const auto first = clock.ping(0, 0);
  for (int i = 0; i < 100; ++i) static_cast<void>(clock.ping(0, 0));
  EXPECT_FALSE(clock.wait_for(first.sequence, kNever)) << "forgotten";
}

}  // namespace
}  // namespace gimnet::nif::test
