#include "client/nif/node_thread.hpp"

#include <gtest/gtest.h>

namespace gimnet::nif {
namespace {

constexpr std::int64_t kBegin = 1'000;

/// An interval of 100, silence after 300.
KeepAliveTimer begun() {
  SessionTerms session;
  session.keep_alive_ns = 100;
  session.silent_after_ns = 300;
  KeepAliveTimer keep_alive;
  keep_alive.begin(session, kBegin);
  return keep_alive;
}

TEST(KeepAliveTimer, IsDueAnIntervalAfterTheLastWrite) {
  KeepAliveTimer keep_alive = begun();
  keep_alive.pinged(kBegin);
  EXPECT_EQ(keep_alive.next(kBegin), kBegin + 100);
  EXPECT_EQ(keep_alive.next(kBegin + 60), kBegin + 100) << "to confirm what came";
  EXPECT_FALSE(keep_alive.ping_due(kBegin + 60, kBegin + 100));
  EXPECT_TRUE(keep_alive.ping_due(kBegin, kBegin + 100));
}

TEST(KeepAliveTimer, LooksAtMostFourTimesInAnInterval) {
  KeepAliveTimer keep_alive = begun();
  keep_alive.ticked(kBegin + 100);
  EXPECT_TRUE(keep_alive.is_early(kBegin + 124));
  EXPECT_FALSE(keep_alive.is_early(kBegin + 125));
  EXPECT_EQ(keep_alive.next(kBegin), kBegin + 125) << "also after a write long ago";
  EXPECT_FALSE(keep_alive.is_late(kBegin + 199));
  EXPECT_TRUE(keep_alive.is_late(kBegin + 200));
}

TEST(KeepAliveTimer, MeasuresTheClockHoweverBusyTheNodeIs) {
  KeepAliveTimer keep_alive = begun();
  EXPECT_TRUE(keep_alive.ping_due(kBegin, kBegin)) << "none on this connection yet";
  keep_alive.pinged(kBegin);
  EXPECT_FALSE(keep_alive.ping_due(kBegin + 499, kBegin + 499));
  EXPECT_TRUE(keep_alive.ping_due(kBegin + 500, kBegin + 500));
}

TEST(KeepAliveTimer, AHubIsSilentOnlyWhileSomebodyListens) {
  KeepAliveTimer keep_alive = begun();
  EXPECT_FALSE(keep_alive.silent_for_too_long(kBegin + 299));
  EXPECT_TRUE(keep_alive.silent_for_too_long(kBegin + 300));
  keep_alive.heard(kBegin + 100);
  EXPECT_FALSE(keep_alive.silent_for_too_long(kBegin + 399));
  keep_alive.set_reading(false, kBegin + 200);
  EXPECT_FALSE(keep_alive.silent_for_too_long(kBegin + 1'000));
  keep_alive.set_reading(true, kBegin + 1'000);
  EXPECT_FALSE(keep_alive.silent_for_too_long(kBegin + 1'299)) << "it gets its whole time again";
  EXPECT_TRUE(keep_alive.silent_for_too_long(kBegin + 1'300));
}

TEST(KeepAliveTimer, WakesWhenTheHubWasSilentForTooLong) {
  KeepAliveTimer keep_alive = begun();
  keep_alive.ticked(kBegin + 250);
  EXPECT_EQ(keep_alive.next(kBegin + 250), kBegin + 300);
  keep_alive.set_reading(false, kBegin + 250);
  EXPECT_EQ(keep_alive.next(kBegin + 250), kBegin + 350);
}

}  // namespace
}  // namespace gimnet::nif
