#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <span>

#include "tests/hub/shard/support/hub_rig.hpp"

// Tests the judgements by the clock of a shard that stood still itself: stopped, starved, or busy
// with others.

namespace gimnet::hub {
namespace {

using proto::DropReason;
using proto::GoodbyeCode;
using testing::FakeNode;
using testing::HubRig;
using ::testing::SizeIs;

constexpr auto kDrop = static_cast<std::uint8_t>(proto::Policy::drop);

/// A turn in which the poller tells nothing: a wait that a signal ended, or others were ready in
/// such numbers.
void turn_without_ready(HubRig& rig) { rig.shard(0).turn({}, rig.now_ms); }

TEST(StalledShard, LooksForWhatIsUnreadBeforeItCallsANodeSilent) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0);
  FakeNode& silent = rig.join(0);
  rig.turn();
  for (FakeNode* node : {&a, &b}) rig.send_flow(*node, proto::flow::Ping{});
  rig.now_ms += 4'000;
  turn_without_ready(rig);
  rig.settle();
  EXPECT_FALSE(a.goodbye);
  EXPECT_THAT(a.flow_of<proto::flow::Pong>(), SizeIs(1));
  EXPECT_FALSE(b.goodbye);
  ASSERT_TRUE(silent.goodbye) << "nothing of it was there to read";
  EXPECT_EQ(silent.goodbye->code, GoodbyeCode::silent);
  EXPECT_EQ(rig.sum(&ShardCounters::silent), 1u);
}

TEST(StalledShard, ClosesForWhatItFindsWhereItLookedForASignOfLife) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  rig.turn();
  rig.send(a, a.id.value(), "not its own", {.src = 99});
  rig.now_ms += 4'000;
  turn_without_ready(rig);
  rig.settle();
  ASSERT_TRUE(a.goodbye);
  EXPECT_EQ(a.goodbye->code, GoodbyeCode::wrong_source);
  EXPECT_EQ(rig.sum(&ShardCounters::silent), 0u);
}

TEST(StalledShard, AFrameHasItsTimeAgainWhereTheHubStoodStill) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  const auto frame = HubRig::frame(a, a.id.value(), "hello");
  rig.write(a, std::span(frame).first(5));
  rig.turn();
  rig.now_ms += 60'000;
  rig.write(a, std::span(frame).subspan(5, 1));
  rig.turn();
  for (std::size_t sent = 6; sent < frame.size(); ++sent) {
    rig.pass_ms(1'000, false);
    rig.write(a, std::span(frame).subspan(sent, 1));
  }
  rig.settle();
  EXPECT_FALSE(a.goodbye);
  EXPECT_EQ(rig.sum(&ShardCounters::stalled_frames), 0u);
  EXPECT_THAT(a.frames, SizeIs(1));
}

TEST(StalledShard, ASlowNodeHasItsTimeAgainWhereTheHubStoodStill) {
  Limits limits;
  limits.silent_ms = 60'000;
  HubRig rig(1, limits);
  FakeNode& a = rig.join(0);
  FakeNode& slow = rig.join(0);
  slow.pipe.set_room(100);
  rig.send(a, slow.id.value(), std::string(10'000, 'x'), {.flags = kDrop});
  rig.send(a, slow.id.value(), std::string(10'000, 'x'), {.flags = kDrop});
  rig.turn();
  rig.pass_ms(1'000);
  rig.now_ms += 20'000;
  rig.turn();
  EXPECT_EQ(rig.sum(&ShardCounters::slow_consumers), 0u);
  rig.pass_ms(8'500);
  EXPECT_EQ(rig.sum(&ShardCounters::slow_consumers), 0u);
  rig.pass_ms(1'000);
  EXPECT_EQ(rig.sum(&ShardCounters::slow_consumers), 1u)
      << "it has been slow for its whole time before others";
}

TEST(StalledShard, ABlockingMessageHasItsTimeAgainWhereTheHubStoodStill) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& slow = rig.join(0);
  slow.pipe.set_room(100);
  for (int i = 0; i < 2; ++i) rig.send(a, slow.id.value(), std::string(10'000, 'x'));
  rig.turn();
  rig.pass_ms(1'000);
  rig.now_ms += 5'000;
  for (FakeNode* node : {&a, &slow}) rig.send_flow(*node, proto::flow::Pong{});
  rig.turn();
  EXPECT_EQ(rig.dropped(DropReason::timed_out), 0u);
  rig.pass_ms(3'500);
  EXPECT_EQ(rig.dropped(DropReason::timed_out), 0u);
  rig.pass_ms(1'000);
  EXPECT_EQ(rig.dropped(DropReason::timed_out), 1u);
}

TEST(StalledShard, ALateTickMovesNothingThatBeganAfterIt) {
  HubRig rig;
  FakeNode& first = rig.join(0);
  rig.turn();
  rig.release(first);
  rig.turn();
  rig.now_ms += 3'600'000;  // nobody to look at: no tick was due
  FakeNode& a = rig.join(0);
  rig.turn();
  rig.pass_ms(2'900, false);
  EXPECT_FALSE(a.pipe.transport_gone());
  rig.pass_ms(200, false);
  EXPECT_TRUE(a.pipe.transport_gone());
}

}  // namespace
}  // namespace gimnet::hub
