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
  clock.on_pong({slow.sequence, 6000, 9999}, 3000);
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
  const auto slow = clock.ping(4'000, 9);
  clock.on_pong({slow.sequence, 9, 99'999}, 5'000);
  EXPECT_EQ(clock.hub_time(3'050), 71'050) << "a longer round trip says less";
  clock.clear();
  EXPECT_EQ(clock.hub_time(3'050), 71'050) << "it goes on while the connection is broken";
  clock.begin(10, 3'050);
  EXPECT_EQ(clock.hub_time(3'050), 10) << "another hub";
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
