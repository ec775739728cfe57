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
