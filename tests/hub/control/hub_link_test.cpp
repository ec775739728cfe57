#include "hub/control/hub_link.hpp"

#include <gtest/gtest.h>

namespace gimnet::hub {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::seconds;

proto::HubIntroduction introduction(std::uint64_t instance = 1) {
  proto::HubIntroduction said;
  said.hub.hub = HubId{9};
  said.instance = proto::HubInstance{instance};
  said.keep_alive_ms = 100;
  said.silent_ms = 3'000;
  return said;
}

/// It breaks and does not come back in time.
void break_once(HubLink& link, milliseconds now) {
  link.end_connection(false, now);
  link.note_break(now);
  link.give_up();
}

/// Begins a connection and breaks it, so many times; it does not come back in time.
void break_often(HubLink& link, int times, milliseconds now, std::uint64_t instance = 1) {
  for (int i = 0; i < times; ++i) {
    link.begin_connection(introduction(instance), {}, now);
    break_once(link, now);
  }
}

TEST(HubLink, TheLargerTimesOfBothEndsCount) {
  HubLink link(LinkNumber{1}, "up");
  link.begin_connection(introduction(), {}, milliseconds{1'000});
  EXPECT_EQ(link.silent_ms(), 3'000u);
  static_cast<void>(link.say_keep_alive(0, milliseconds{1'000}, 0));
  EXPECT_EQ(link.keep_alive_at(), milliseconds{1'000 + kLinkKeepAliveMs});
}

TEST(HubLink, TimesThatNeverEndCountAsAnHour) {
  HubLink link(LinkNumber{1}, "up");
  proto::HubIntroduction said = introduction();
  said.silent_ms = said.keep_alive_ms = UINT32_MAX;
  link.begin_connection(said, {}, milliseconds{1'000});
  EXPECT_EQ(link.silent_ms(), 3'600'000u);
  EXPECT_EQ(link.keep_alive_ms(), 3'600'000u);
  said.silent_ms = said.keep_alive_ms = 0;
  link.begin_connection(said, {}, milliseconds{2'000});
  EXPECT_EQ(link.silent_ms(), kLinkSilentMs);
}

TEST(HubLink, MayComeBackForItsTimeAndFourRoundTrips) {
  HubLink link(LinkNumber{1}, "up");
  link.begin_connection(introduction(), {}, milliseconds{1'000});
  proto::route::KeepAlive heard;
  heard.heard_sent_ns = 1'000'000'000;
  heard.heard_ns = heard.sent_ns = 7'000'000'000;
  // 20 ms after it was sent, and not held there.
  EXPECT_TRUE(link.hear_keep_alive(heard, milliseconds{1'020}, 1'020'000'000));
  EXPECT_EQ(link.cost(), LinkCost::kLeastMeasured + 20);
  EXPECT_EQ(link.clock().ahead, std::chrono::nanoseconds{7'000'000'000 - 1'010'000'000});
  link.end_connection(false, milliseconds{2'000});
  EXPECT_EQ(link.resume_until(), milliseconds{2'000 + 300 + 80});
}

TEST(HubLink, IsAliveIfItIsHeardWellAfterTheQuestion) {
  const milliseconds interval{kLinkKeepAliveMs};
  for (const bool lives : {true, false}) {
    HubLink link(LinkNumber{1}, "up");
    link.begin_connection(introduction(), {}, milliseconds{1'000});
    const auto hear = [&link](milliseconds now) {
      static_cast<void>(link.hear_keep_alive({}, now, 0));
    };
    const milliseconds asked{5'000};
    hear(asked - milliseconds{1});
    EXPECT_EQ(link.is_alive(asked), HubLink::Alive::not_known);
    hear(asked + milliseconds{1});  // was under way
    EXPECT_EQ(link.is_alive(asked + interval), HubLink::Alive::not_known);
    if (lives) hear(asked + interval + milliseconds{1});
    EXPECT_EQ(link.is_alive(asked + 2 * interval),
              lives ? HubLink::Alive::yes : HubLink::Alive::no);
    EXPECT_EQ(link.is_alive(asked + 10 * interval), HubLink::Alive::no) << "long silent";
    link.end_connection(false, asked);
    EXPECT_EQ(link.is_alive(asked), HubLink::Alive::no);
  }
}

TEST(HubLink, AClockThatWasSetMeanwhileTellsNothing) {
  HubLink link(LinkNumber{1}, "up");
  link.begin_connection(introduction(), {}, milliseconds{0});
  proto::route::KeepAlive heard;
  heard.heard_sent_ns = 2'000'000'000;
  heard.heard_ns = heard.sent_ns = 5;
  EXPECT_FALSE(link.hear_keep_alive(heard, milliseconds{10}, 1'000'000'000))
      << "sent in the future";
  EXPECT_EQ(link.clock().round_trip_least.count(), 0);
}

/// A keep-alive that was answered at once, `round_trip` after it was sent, by a clock that is
/// `ahead`.
void hear(HubLink& link, nanoseconds round_trip, nanoseconds ahead) {
  proto::route::KeepAlive heard;
  const std::int64_t now_ns = 1'000'000'000'000;
  heard.heard_sent_ns = now_ns - round_trip.count();
  heard.sent_ns = heard.heard_ns = now_ns - round_trip.count() / 2 + ahead.count();
  static_cast<void>(link.hear_keep_alive(heard, milliseconds{1'000'000}, now_ns));
}

TEST(HubLink, TheShortestOfTheLatestRoundTripsComparesTheClocks) {
  HubLink link(LinkNumber{1}, "up");
  link.begin_connection(introduction(), {}, milliseconds{0});
  hear(link, milliseconds{2}, seconds{5});
  hear(link, milliseconds{8}, seconds{5} + milliseconds{2});
  EXPECT_EQ(link.clock().ahead, seconds{5});
  EXPECT_EQ(link.clock().error, milliseconds{1});
  for (std::size_t i = 0; i < HubLink::kClockSamples; ++i)
    hear(link, milliseconds{8}, seconds{5} + milliseconds{2});
  EXPECT_EQ(link.clock().ahead, seconds{5} + milliseconds{2}) << "clocks drift";
  EXPECT_EQ(link.clock().round_trip_least, milliseconds{2});
}

TEST(HubLink, AClockThatIsSetIsFollowedAtOnce) {
  HubLink link(LinkNumber{1}, "up");
  link.begin_connection(introduction(), {}, milliseconds{0});
  for (int i = 0; i < 20; ++i) hear(link, milliseconds{2}, seconds{5});
  hear(link, milliseconds{20}, seconds{-30});
  EXPECT_EQ(link.clock().ahead, seconds{-30});
  EXPECT_EQ(link.clock().error, milliseconds{10});
}

TEST(HubLink, IsDampedFromTheThirdBreakOn) {
  HubLink link(LinkNumber{1}, "up");
  const milliseconds now{100'000};
  break_often(link, 2, now);
  link.begin_connection(introduction(), {}, now);
  EXPECT_FALSE(link.damped_until());
  break_once(link, now);
  link.begin_connection(introduction(), {}, now);
  EXPECT_EQ(link.damped_until(), now + milliseconds{1'000});
  break_once(link, now);
  EXPECT_FALSE(link.damped_until()) << "nobody is told of it";
  link.begin_connection(introduction(), {}, now);
  EXPECT_EQ(link.damped_until(), now + milliseconds{2'000});
  break_often(link, 20, now);
  link.begin_connection(introduction(), {}, now);
  EXPECT_EQ(link.damped_until(), now + HubLink::kDampedMost);
  break_once(link, now);
  link.begin_connection(introduction(), {}, now + HubLink::kBreaksWithin);
  EXPECT_FALSE(link.damped_until()) << "a minute without a break";
}

TEST(HubLink, ABreakThatIsResumedNeitherDampsNorUndamps) {
  HubLink link(LinkNumber{1}, "up");
  const milliseconds now{100'000};
  for (int i = 0; i < 20; ++i) {
    link.begin_connection(introduction(), {}, now);
    link.end_connection(false, now);
  }
  link.begin_connection(introduction(), {}, now);
  EXPECT_FALSE(link.damped_until());
  break_once(link, now);
  break_often(link, 2, now);
  link.begin_connection(introduction(), {}, now);
  ASSERT_EQ(link.damped_until(), now + milliseconds{1'000});
  link.end_connection(false, now + milliseconds{900});
  EXPECT_TRUE(link.damped_until());
  link.begin_connection(introduction(), {}, now + milliseconds{950});
  EXPECT_EQ(link.damped_until(), now + milliseconds{1'000});
  link.begin_connection(introduction(), {}, now + milliseconds{960});
  EXPECT_EQ(link.damped_until(), now + milliseconds{1'000}) << "it came back before it was missed";
}

TEST(HubLink, ARestartOfTheOtherHubIsNoBreakOfTheLink) {
  HubLink link(LinkNumber{1}, "up");
  for (std::uint64_t instance = 1; instance < 10; ++instance)
    break_often(link, 1, milliseconds{100'000}, instance);
  link.begin_connection(introduction(50), {}, milliseconds{100'000});
  EXPECT_FALSE(link.damped_until());
}

TEST(HubLink, AfterAGoodbyeNothingIsResumed) {
  HubLink link(LinkNumber{1}, "up");
  link.begin_connection(introduction(), {}, milliseconds{0});
  link.epoch = 5;
  link.end_connection(true, milliseconds{0});
  EXPECT_FALSE(link.resume_until());
  EXPECT_EQ(link.epoch, 0u);
}

}  // namespace
}  // namespace gimnet::hub
