#include "hub/shard/signals.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "tests/hub/shard/support/hub_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::DropReason;
using proto::flow::Pause;
using proto::flow::Resume;
using proto::flow::Target;
using ::testing::ElementsAre;
using testing::FakeNode;
using testing::HubRig;
using ::testing::SizeIs;

Limits small_limits() {
  Limits limits;
  limits.lane1_bytes = 64 * 1024;
  limits.reserve_bytes = 32 * 1024;
  limits.mailbox_bytes = 1 << 20;
  return limits;
}

class SignalsAcross : public ::testing::TestWithParam<std::size_t> {};

// The sender on the recipient's shard, and on another one.
INSTANTIATE_TEST_SUITE_P(Shards, SignalsAcross, ::testing::Values(0, 1));

TEST_P(SignalsAcross, PausesASenderAndResumesIt) {
  HubRig rig(2, small_limits());
  FakeNode& a = rig.join(GetParam());
  FakeNode& b = rig.join(0);
  b.pipe.set_room(0);
  const std::string payload(1024 - proto::kHeaderSize, 'x');
  for (int i = 0; i < 32; ++i) {  // half of the lane
    rig.send(a, b.id.value(), payload);
    rig.turn();
  }
  rig.settle();
  EXPECT_THAT(a.flow_of<Pause>(), SizeIs(0)) << "at the limit";
  rig.send(a, b.id.value(), payload);
  rig.settle_without_reading();
  a.read();
  const Target target{proto::Kind::unicast, proto::Lane::normal, b.id.value()};
  EXPECT_THAT(a.flow_of<Pause>(), ElementsAre(Pause{target}));
  EXPECT_THAT(a.flow_of<Resume>(), SizeIs(0));
  b.pipe.set_room(MemoryPeer::kAll);
  rig.settle();
  EXPECT_THAT(a.flow_of<Resume>(), ElementsAre(Resume{target}));
  EXPECT_THAT(b.frames, SizeIs(33));
  EXPECT_EQ(rig.ledger().dropped, 0u);
  EXPECT_EQ(rig.sum(&ShardCounters::pauses), 1u);
  EXPECT_EQ(rig.sum(&ShardCounters::resumes), 1u);
}

TEST_P(SignalsAcross, ASenderThatIgnoresPauseIsNotReadUntilThereIsRoom) {
  HubRig rig(2, small_limits());
  FakeNode& a = rig.join(GetParam());
  FakeNode& b = rig.join(0);
  FakeNode& c = rig.join(1);
  b.pipe.set_room(0);
  const std::string payload(1024 - proto::kHeaderSize, 'x');
  a.pipe.plan_receives(std::vector<std::size_t>(100'000, 4'096));
  for (int i = 0; i < 1'000; ++i) rig.send(a, b.id.value(), payload);
  rig.send(a, c.id.value(), "behind it");
  rig.settle_without_reading();
  EXPECT_TRUE(a.pipe.transport_readable()) << "held";
  EXPECT_EQ(rig.sum(&ShardCounters::held_reads), 1u);
  EXPECT_LE(rig.ledger().accepted, 64u + 32u + 3 * 4u);
  // Its keep-alive clock stands still meanwhile; the recipient is slow, not silent.
  rig.send_flow(b, proto::flow::Pong{});
  for (int i = 0; i < 4; ++i) {
    rig.pass_ms(1'000, false);
    rig.send_flow(b, proto::flow::Pong{});
    rig.send_flow(c, proto::flow::Pong{});
  }
  EXPECT_FALSE(a.pipe.transport_gone());
  b.pipe.set_room(MemoryPeer::kAll);
  rig.settle();
  EXPECT_THAT(b.frames, SizeIs(1'000));
  EXPECT_THAT(c.texts(), ElementsAre("behind it"));
  EXPECT_EQ(rig.ledger().dropped, 0u);
}

TEST_P(SignalsAcross, ManySendersToOneThatDoesNotReadLoseNothing) {
  HubRig rig(2, small_limits());
  std::vector<FakeNode*> senders;
  for (int i = 0; i < 30; ++i) senders.push_back(&rig.join(GetParam()));
  FakeNode& b = rig.join(0);
  b.pipe.set_room(0);
  constexpr int kFrames = 200;
  const std::string payload(1024 - proto::kHeaderSize, 'x');
  for (FakeNode* sender : senders) {
    for (int i = 0; i < kFrames; ++i)
      rig.send(*sender, b.id.value(), std::to_string(i) + ' ' + payload);
  }
  rig.settle_without_reading();
  EXPECT_EQ(rig.ledger().dropped, 0u);
  EXPECT_GT(rig.ledger().queued, 64u + 8 * 32) << "more than the lane and eight reserves";
  b.pipe.set_room(MemoryPeer::kAll);
  rig.settle();
  EXPECT_EQ(rig.ledger().dropped, 0u);
  EXPECT_THAT(b.frames, SizeIs(30 * kFrames));
  std::map<std::uint32_t, int> next;
  for (const testing::GotFrame& frame : b.frames)
    EXPECT_EQ(std::stoi(frame.text()), next[frame.header.src]++);
  for (const FakeNode* sender : senders) EXPECT_EQ(rig.connection(*sender)->holds, 0u);
}

TEST_P(SignalsAcross, AHeldSenderGoesOnWhenTheRecipientLeaves) {
  HubRig rig(2, small_limits());
  FakeNode& a = rig.join(GetParam());
  FakeNode& b = rig.join(0);
  b.pipe.set_room(0);
  const std::string payload(1024 - proto::kHeaderSize, 'x');
  a.pipe.plan_receives(std::vector<std::size_t>(100'000, 4'096));
  for (int i = 0; i < 300; ++i) rig.send(a, b.id.value(), payload);
  rig.settle_without_reading();
  EXPECT_TRUE(a.pipe.transport_readable());
  rig.release(b);
  rig.settle();
  EXPECT_FALSE(a.pipe.transport_readable());
  EXPECT_EQ(rig.ledger().queued, 0u);
  EXPECT_EQ(rig.ledger().dropped, 300u);
  EXPECT_THAT(a.flow_of<Resume>(), SizeIs(1));
}

TEST_P(SignalsAcross, ReportsToASenderThatAskedForIt) {
  HubRig rig(2);
  FakeNode& a = rig.join(GetParam());
  const std::uint32_t nobody = 7u << 20 | 999;
  rig.send(a, nobody, "0123456789abcdefghijXYZ", {.flags = proto::kFlagReport});
  rig.send(a, nobody, "not asked for");
  rig.settle();
  ASSERT_THAT(a.reports(), SizeIs(1));
  const proto::Report report = a.reports()[0];
  EXPECT_EQ(report.reason, DropReason::no_such_node);
  EXPECT_EQ(report.count, 1u);
  EXPECT_EQ(report.header.dst, nobody);
  EXPECT_EQ(report.following.size(), proto::kReportFollowingMax);
  EXPECT_EQ(rig.dropped(DropReason::no_such_node), 2u);
}

TEST(Signals, MergesReportsWithinTheInterval) {
  HubRig rig(1);
  FakeNode& a = rig.join(0);
  const std::uint32_t nobody = 7u << 20 | 999;
  for (int i = 0; i < 5; ++i) {
    rig.send(a, nobody, std::to_string(i), {.flags = proto::kFlagReport});
    rig.turn();
  }
  rig.settle();
  EXPECT_THAT(a.reports(), SizeIs(1));
  rig.now_ms += 10;
  rig.settle();
  ASSERT_THAT(a.reports(), SizeIs(2));
  EXPECT_EQ(a.reports()[0].count + a.reports()[1].count, 5u);
}

// A hub that started again gets frames over a link before it knows the way back to their hub.
TEST(Signals, AReportToAnotherHubWaitsForAWayThere) {
  for (const bool comes : {true, false}) {
    HubRig rig;
    const HubId near{9};
    FakeNode& link = rig.link(0, near);
    rig.routes().publish(near, {});
    rig.send(link, 7u << 20 | 999, "x",
             {.flags = proto::kFlagReport, .src = make_id<NodeId>(near, 5).value()});
    rig.settle();
    EXPECT_THAT(link.reports(), SizeIs(0));
    if (comes) {
      const NodePlace place{link.shard, link.session.slot, link.session.generation};
      rig.routes().publish(near, {place, near});
    }
    for (std::uint64_t ms = 0; ms <= DropBook::kKeptMs; ms += 100) {
      rig.now_ms += 100;
      rig.turn_shard(0);
      link.read();
    }
    EXPECT_THAT(link.reports(), SizeIs(comes ? 1 : 0));
    EXPECT_EQ(rig.sum(&ShardCounters::reports_lost), comes ? 0u : 1u);
  }
}

// Its silence is not looked at while it is not read: that its machine is gone tells the kernel.
TEST(Signals, WhoIsNotReadHasToTakeWhatItIsSent) {
  Limits limits;
  limits.unacknowledged_ms = 1'234;
  HubRig rig(1, limits);
  FakeNode& a = rig.join(0);
  Signals& signals = rig.state(0).signals;
  EXPECT_EQ(a.pipe.unacknowledged_limit(), 0u)
      << "who is read and does not take LATEST messages may stay";
  signals.apply_hold(a.id, true);
  EXPECT_EQ(a.pipe.unacknowledged_limit(), 1'234u);
  signals.apply_hold(a.id, true);
  signals.apply_hold(a.id, false);
  EXPECT_EQ(a.pipe.unacknowledged_limit(), 1'234u) << "held by another one still";
  rig.rejoin(a);
  EXPECT_EQ(a.pipe.unacknowledged_limit(), 1'234u) << "a new connection of one who is held";
  signals.apply_hold(a.id, false);
  EXPECT_EQ(a.pipe.unacknowledged_limit(), 0u);
}

TEST(Signals, TwoNodesThatFloodEachOtherDoNotStandStill) {
  HubRig rig(2, small_limits());
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(1);
  a.pipe.set_room(8'192);
  b.pipe.set_room(8'192);
  const std::string payload(1024 - proto::kHeaderSize, 'x');
  for (int i = 0; i < 2'000; ++i) {
    rig.send(a, b.id.value(), payload);
    rig.send(b, a.id.value(), payload);
  }
  rig.settle();
  EXPECT_THAT(a.frames, SizeIs(2'000));
  EXPECT_THAT(b.frames, SizeIs(2'000));
  EXPECT_EQ(rig.ledger().dropped, 0u);
}

// A peer that was told PAUSE and cannot be told RESUME starts anew: a connection begins with
// nothing paused. One for each of its recipients that is full, and lane: more than 16 bits can
// count.
TEST(Signals, CountsHoldsOfManyRecipients) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  constexpr std::uint32_t kHolds = 70'000;
  for (std::uint32_t i = 0; i < kHolds; ++i) rig.state(0).signals.hold(a.id);
  for (std::uint32_t i = 0; i + 1 < kHolds; ++i) rig.state(0).signals.release(a.id);
  EXPECT_EQ(rig.connection(a)->holds, 1u);
  EXPECT_FALSE(rig.connection(a)->armed.read);
  rig.state(0).signals.release(a.id);
  EXPECT_TRUE(rig.connection(a)->armed.read);
}

TEST(Signals, WhoHasNoRoomForResumeIsClosed) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  a.pipe.set_room(0);
  const std::vector<std::byte> word(64);
  while (rig.connection(a)->outbox.push_control(word, rig.state(0).egress)) {
  }
  const proto::flow::Target target{proto::Kind::unicast, proto::Lane::normal, a.id.value()};
  rig.state(0).signals.pause(a.id, target);
  rig.pass_ms(200, false);
  EXPECT_TRUE(rig.connection(a)->connected) << "PAUSE is told again";
  rig.state(0).signals.resume(a.id, target);
  rig.pass_ms(200, false);
  EXPECT_FALSE(rig.connection(a)->connected);
}

// The words of a node about what it took may lie behind the data for which it is held.
TEST(Signals, AHeldNodeThatMustConfirmIsRead) {
  Limits limits;
  limits.resume_bytes = 4'096;
  HubRig rig(1, limits);
  FakeNode& flooder = rig.join(0);
  FakeNode& confirmer = rig.join(0, {.resume = true});
  for (int i = 0; i < 8; ++i) rig.send(flooder, confirmer.id.value(), std::string(1'000, 'x'));
  rig.settle();
  ASSERT_LT(confirmer.frames.size(), 8u) << "the rest waits for a CONFIRM";
  rig.state(0).signals.apply_hold(confirmer.id, true);
  rig.send_flow(confirmer, proto::flow::Confirm{confirmer.data_frames});
  rig.settle();
  EXPECT_GT(confirmer.frames.size(), 4u);
  rig.send_flow(confirmer, proto::flow::Confirm{confirmer.data_frames});
  rig.settle();
  EXPECT_EQ(confirmer.frames.size(), 8u);
  EXPECT_FALSE(rig.connection(confirmer)->armed.read)
      << "with nothing left to write it is held as any other";
}

TEST(Signals, WhoSendsToAServiceThatOnlyProvidesIsTold) {
  for (const std::size_t shard : {0u, 1u}) {
    HubRig rig(2);
    FakeNode& provider = rig.join(shard);
    FakeNode& client = rig.join(0);
    rig.publish_group(5, provider.id, {&client});
    rig.send(client, HubRig::group(5), "request",
             {.kind = proto::Kind::service, .flags = proto::kFlagReport});
    rig.settle();
    rig.pass_ms(100);
    client.read();
    EXPECT_TRUE(provider.frames.empty());
    EXPECT_EQ(rig.dropped(DropReason::not_allowed), 1u);
    ASSERT_EQ(client.reports().size(), 1u);
    EXPECT_EQ(client.reports()[0].reason, DropReason::not_allowed);
    EXPECT_EQ(client.reports()[0].header.dst, HubRig::group(5));
  }
}

TEST(Signals, WhoseHubALinkMayNotSpeakForIsToldOverIt) {
  constexpr HubId kNear{20};
  constexpr HubId kFar{30};
  const std::uint32_t near_node = make_id<NodeId>(kNear, 3).value();
  for (const std::size_t shard : {0u, 1u}) {
    HubRig rig(2);
    FakeNode& node = rig.join(0);
    FakeNode& link = rig.link(shard, kNear, {.allow = {kFar}});
    const auto send = [&](std::uint32_t source, std::uint8_t flags) {
      rig.send(link, node.id.value(), "hello", {.flags = flags, .src = source});
    };
    send(make_id<NodeId>(kFar, 3).value(), proto::kFlagReport);
    send(near_node, 0);
    send(node.id.value(), proto::kFlagReport);  // as this hub's own node
    send(near_node, proto::kFlagReport);
    rig.settle();
    rig.pass_ms(100);
    link.read();
    EXPECT_THAT(node.frames, SizeIs(1));
    EXPECT_EQ(rig.dropped(DropReason::not_allowed), 2u);
    EXPECT_EQ(rig.dropped(DropReason::wrong_source), 1u);
    ASSERT_THAT(link.reports(), SizeIs(1)) << "of the one that asked for it";
    EXPECT_EQ(link.reports()[0].reason, DropReason::not_allowed);
    EXPECT_EQ(link.reports()[0].header.dst, node.id.value());
    EXPECT_EQ(link.control.back().header.dst, near_node) << "the report goes to the sender";
    EXPECT_FALSE(link.goodbye) << "the link stays";
  }
}

}  // namespace
}  // namespace gimnet::hub
