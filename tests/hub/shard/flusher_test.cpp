#include "hub/shard/flusher.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "tests/hub/shard/support/hub_rig.hpp"
#include "tests/net/support/toy_stream.hpp"

namespace gimnet::hub {
namespace {

using proto::DropReason;
using proto::GoodbyeCode;
using ::testing::ElementsAre;
using testing::FakeNode;
using testing::HubRig;
using ::testing::SizeIs;

/// A node whose stream keeps bytes of its own.
FakeNode& join_over_a_toy_stream(HubRig& rig) {
  const bool already = net::toy_streams_wanted();
  ::setenv("GIMNET_TEST_STREAM", "toy", 1);
  FakeNode& node = rig.join(0);
  if (!already) ::unsetenv("GIMNET_TEST_STREAM");
  return node;
}

constexpr std::uint8_t kLatestKeyed =
    static_cast<std::uint8_t>(proto::Policy::latest) | proto::kFlagKeyed;

TEST(Flusher, WritesManyFramesInOneCall) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0);
  const std::uint64_t calls = b.pipe.send_calls();
  for (int i = 0; i < 50; ++i)
    rig.send(a, b.id.value(), std::to_string(i), {.lane = static_cast<std::uint8_t>(i % 4)});
  rig.settle();
  EXPECT_THAT(b.frames, SizeIs(50));
  EXPECT_EQ(b.pipe.send_calls() - calls, 1u);
}

TEST(Flusher, GoesOnWhereTheTransportStopped) {
  for (std::size_t room = 1; room < 60; ++room) {
    HubRig rig;
    FakeNode& a = rig.join(0);
    FakeNode& b = rig.join(0);
    b.pipe.set_room(room);
    for (int i = 0; i < 5; ++i) rig.send(a, b.id.value(), std::to_string(i));
    rig.settle();
    EXPECT_THAT(b.texts(), ElementsAre("0", "1", "2", "3", "4")) << "room " << room;
  }
}

TEST(Flusher, WaitsForTheKernelToTakeWhatTheStreamTook) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = join_over_a_toy_stream(rig);
  // Two records: of the second one the kernel takes a part.
  b.pipe.plan_sends({2 * net::ToyCode::kRecord - 1});
  rig.send(a, b.id.value(), "whole");
  rig.turn();
  EXPECT_TRUE(rig.connection(b)->outbox.empty());
  EXPECT_TRUE(rig.connection(b)->armed.write);
  rig.settle();
  EXPECT_THAT(b.texts(), ElementsAre("whole"));
  EXPECT_FALSE(rig.connection(b)->armed.write);
}

TEST(Flusher, TheNextOneThatWaitsTakesNoNewMemoryToBeWatched) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  const Progress* used = nullptr;
  for (int i = 0; i < 3; ++i) {
    FakeNode& waiting = rig.join(0);
    waiting.pipe.set_room(1'000);
    for (int message = 0; message < 3; ++message)
      rig.send(a, waiting.id.value(), std::string(1'000, 'x'));
    rig.settle_without_reading();
    const std::unique_ptr<Progress>& progress = rig.connection(waiting)->progress;
    ASSERT_TRUE(progress);
    EXPECT_EQ(progress->since_ms, rig.now_ms) << "nothing is left of the one before";
    EXPECT_TRUE(used == nullptr || progress.get() == used);
    used = progress.get();
    rig.settle();
    rig.pass_ms(200);
    EXPECT_FALSE(progress) << "it has taken everything";
  }
}

TEST(Flusher, ClosesASlowConsumerAndTellsIt) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& slow = rig.join(0);
  slow.pipe.set_room(1'000);
  for (int i = 0; i < 20; ++i) rig.send(a, slow.id.value(), std::string(1'000, 'x'), {.flags = 2});
  rig.pass_ms(9'900);
  EXPECT_FALSE(slow.pipe.transport_gone());
  rig.pass_ms(400);
  EXPECT_TRUE(slow.pipe.transport_gone());
  EXPECT_EQ(rig.sum(&ShardCounters::slow_consumers), 1u);
  const auto detached = rig.take_detached();
  ASSERT_TRUE(detached);
  EXPECT_EQ(detached->code, GoodbyeCode::slow_consumer);
  EXPECT_EQ(rig.dropped(DropReason::link_lost), 20u);
}

// It keeps alive, and of all that it was sent a part of one frame waits, which is in no lane any
// more.
TEST(Flusher, ClosesAConsumerThatTookAPartOfOneFrame) {
  for (const std::uint8_t policy : {std::uint8_t{0}, std::uint8_t{2}}) {
    HubRig rig;
    FakeNode& a = rig.join(0);
    FakeNode& slow = rig.join(0);
    slow.pipe.set_room(1'000);
    rig.send(a, slow.id.value(), std::string(10'000, 'x'), {.flags = policy});
    rig.pass_ms(9'900);
    EXPECT_FALSE(slow.pipe.transport_gone());
    rig.pass_ms(400);
    EXPECT_TRUE(slow.pipe.transport_gone());
    EXPECT_EQ(rig.sum(&ShardCounters::slow_consumers), 1u);
    EXPECT_EQ(rig.dropped(DropReason::link_lost), 1u);
  }
}

TEST(Flusher, KeepsAConsumerThatTakesJustEnough) {
  for (const std::size_t bytes_per_s : {350u, 450u}) {
    HubRig rig;
    FakeNode& a = rig.join(0);
    FakeNode& slow = rig.join(0);
    slow.pipe.set_room(1'000);
    for (int i = 0; i < 50; ++i)
      rig.send(a, slow.id.value(), std::string(1'000, 'x'), {.flags = 2});
    for (int second = 0; second < 25; ++second) {
      slow.read(bytes_per_s);
      rig.pass_ms(1'000);
    }
    EXPECT_EQ(slow.pipe.transport_gone(), bytes_per_s < 400u);
  }
}

TEST(Flusher, DoesNotCallAConsumerSlowForWaitingLatest) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& slow = rig.join(0);
  slow.pipe.set_room(0);
  for (int i = 0; i < 200; ++i) {
    rig.send(a, slow.id.value(), "12345678" + std::to_string(i), {.flags = kLatestKeyed});
    rig.pass_ms(100);
  }
  EXPECT_FALSE(slow.pipe.transport_gone());
  EXPECT_EQ(rig.dropped(DropReason::replaced), 199u);
  slow.pipe.set_room(MemoryPeer::kAll);
  rig.settle();
  EXPECT_THAT(slow.texts(), ElementsAre("12345678199"));
}

TEST(Flusher, DoesNotCallAConsumerSlowForAPartOfALatestMessage) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& slow = rig.join(0);
  slow.pipe.set_room(100);
  rig.send(a, slow.id.value(), "12345678" + std::string(1'000, 'x'), {.flags = kLatestKeyed});
  rig.pass_ms(20'000);
  EXPECT_FALSE(slow.pipe.transport_gone());
}

TEST(Flusher, DropsBlockedMessagesAfterFiveSecondsWithoutProgress) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0);
  b.pipe.set_room(0);
  rig.send(a, b.id.value(), "waits", {.flags = proto::kFlagReport});
  rig.pass_ms(4'900);
  EXPECT_EQ(rig.ledger().dropped, 0u);
  rig.pass_ms(400);
  rig.settle();
  EXPECT_EQ(rig.dropped(DropReason::timed_out), 1u);
  ASSERT_THAT(a.reports(), SizeIs(1));
  EXPECT_EQ(a.reports()[0].reason, DropReason::timed_out);
  EXPECT_EQ(a.reports()[0].count, 1u);
  EXPECT_EQ(a.reports()[0].header.dst, b.id.value());
}

// Its queue is empty each time that messages time out, but it has caught up with nothing.
TEST(Flusher, ClosesASlowConsumerWhoseMessagesTimeOut) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& slow = rig.join(0);
  slow.pipe.set_room(1'000);
  for (int i = 0; i < 20; ++i) {
    rig.send(a, slow.id.value(), std::string(1'000, 'x'));
    rig.pass_ms(600);
  }
  EXPECT_TRUE(slow.pipe.transport_gone());
  EXPECT_EQ(rig.sum(&ShardCounters::slow_consumers), 1u);
}

TEST(Flusher, KeepsAConsumerThatCatchesUpAfterMessagesTimedOut) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& late = rig.join(0);
  late.pipe.set_room(1'000);
  for (int i = 0; i < 3; ++i) rig.send(a, late.id.value(), std::string(1'000, 'x'));
  rig.pass_ms(6'000);
  EXPECT_GT(rig.dropped(DropReason::timed_out), 0u);
  late.pipe.set_room(MemoryPeer::kAll);
  for (int second = 0; second < 12; ++second) {
    late.read(10'000);
    rig.pass_ms(1'000);
  }
  EXPECT_FALSE(late.pipe.transport_gone());
}

TEST(Flusher, ByteByByteIsProgressForBlock) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0);
  b.pipe.set_room(10);
  for (int i = 0; i < 3; ++i) rig.send(a, b.id.value(), std::string(100, 'x'));
  for (int i = 0; i < 9; ++i) {
    rig.pass_ms(1'000);
    b.read(1);
  }
  EXPECT_EQ(rig.ledger().dropped, 0u);
}

/// A node that asked for what it did not confirm to be kept, of which there is room for four
/// messages.
class FlusherOfAResumer : public ::testing::Test {
 protected:
  static Limits small() {
    Limits limits;
    limits.resume_bytes = 4'096;
    return limits;
  }
  void send(int count) {
    for (int i = 0; i < count; ++i) rig.send(a, b.id.value(), std::string(1'000, 'x'));
  }

  HubRig rig{1, small()};
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0, {.resume = true});
};

// A node that reads, says PING and never confirms what it asked to be kept: nothing waits for it
// for ever.
TEST_F(FlusherOfAResumer, TimesOutANodeThatNeverConfirms) {
  send(20);
  rig.settle();
  EXPECT_THAT(b.frames, SizeIs(4)) << "as many as the resume buffer holds";
  rig.pass_ms(5'400);
  rig.settle();
  EXPECT_EQ(rig.dropped(DropReason::timed_out), 16u);
}

// The node takes the answers of the hub, but nothing of the frames that wait.
TEST_F(FlusherOfAResumer, TimesOutANodeThatNeverConfirmsButAsks) {
  send(20);
  rig.settle();
  for (int i = 0; i < 54; ++i) {
    rig.send_flow(b, proto::flow::Ping{});
    rig.pass_ms(100);
    b.read();
  }
  rig.settle();
  EXPECT_GE(b.flow_of<proto::flow::Pong>().size(), 54u);
  EXPECT_EQ(rig.dropped(DropReason::timed_out), 16u);
  EXPECT_FALSE(b.pipe.transport_gone());
}

TEST_F(FlusherOfAResumer, AConfirmIsProgressThoughItMakesNoRoomYet) {
  send(4);
  rig.send(a, b.id.value(), std::string(4'000, 'y'));
  rig.settle();
  ASSERT_THAT(b.frames, SizeIs(4))
      << "the last one has no room in the resume buffer before all are confirmed";
  for (std::uint64_t confirmed = 1; confirmed <= 3; ++confirmed) {
    rig.pass_ms(3'000);
    rig.send_flow(b, proto::flow::Confirm{confirmed});
    rig.settle();
    EXPECT_THAT(b.frames, SizeIs(4));
  }
  rig.send_flow(b, proto::flow::Confirm{4});
  rig.settle();
  EXPECT_THAT(b.frames, SizeIs(5));
  EXPECT_EQ(rig.ledger().dropped, 0u);
}

TEST_F(FlusherOfAResumer, GoesOnAfterAConfirm) {
  send(20);
  for (int i = 0; i < 5; ++i) {
    rig.settle();
    rig.send_flow(b, proto::flow::Confirm{b.data_frames});
  }
  rig.settle();
  EXPECT_THAT(b.frames, SizeIs(20));
  EXPECT_EQ(rig.ledger().delivered, 20u);
}

TEST(Flusher, BoundsWhatWaitsUnsentBehindASlowConnection) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0);
  b.pipe.set_room(60'000);
  for (int i = 0; i < 60; ++i) rig.send(a, b.id.value(), std::string(10'000, 'x'));
  for (int step = 0; step < 10; ++step) {
    rig.pass_ms(100);
    b.read(20'000);  // 200 KB/s
  }
  EXPECT_GE(b.pipe.unsent_limit(), 4'096u);
  EXPECT_LE(b.pipe.unsent_limit(), 20'000u) << "at most 100 ms of it";
}

TEST(Flusher, WhatMayWaitUnsentIsATimeAndAtMostBytes) {
  const auto unsent_at = [](std::uint64_t ms, std::uint64_t bytes) {
    Limits limits;
    limits.unsent_ms = ms;
    limits.unsent_bytes = bytes;
    HubRig rig(1, limits);
    FakeNode& a = rig.join(0);
    FakeNode& b = rig.join(0);
    b.pipe.set_room(60'000);
    for (int i = 0; i < 60; ++i) rig.send(a, b.id.value(), std::string(10'000, 'x'));
    for (int step = 0; step < 10; ++step) {
      rig.pass_ms(100);
      b.read(20'000);  // 200 KB/s
    }
    return b.pipe.unsent_limit();
  };
  EXPECT_GT(unsent_at(1'000, 1 << 20), 128u * 1024) << "what it takes in a second";
  EXPECT_EQ(unsent_at(1'000, 150'000), 150'000u) << "bounded";
  EXPECT_EQ(unsent_at(1'000, 4'096), 4'096u) << "from its first byte on";
}

TEST(Flusher, ABrokenTransportEndsTheConnectionOnly) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0);
  FakeNode& c = rig.join(0);
  b.pipe.reset_after(5);
  rig.send(a, b.id.value(), "lost");
  rig.send(a, c.id.value(), "arrives");
  rig.settle();
  EXPECT_THAT(c.texts(), ElementsAre("arrives"));
  EXPECT_EQ(rig.dropped(DropReason::link_lost), 1u);
  const auto detached = rig.take_detached();
  ASSERT_TRUE(detached);
  EXPECT_EQ(detached->node, b.id);
  EXPECT_FALSE(detached->said_by_peer);
}

/// Bytes that wait in lane 1 of a peer that takes so many each 100 ms and is sent more.
double waiting_for(HubRig& rig, FakeNode& from, FakeNode& peer, std::size_t takes) {
  const auto to = peer.id.value() + (index_of(peer.id) == kHubIndex ? 1 : 0);  // a node behind it
  peer.pipe.set_room(takes + 10'000);
  for (int step = 0; step < 10; ++step) {
    for (std::size_t sent = 0; sent < 3 * takes; sent += 10'000)
      rig.send(from, to, std::string(10'000, 'x'), {.flags = 2});
    rig.settle_without_reading();
    peer.read(takes);
    rig.pass_ms(100);
  }
  for (int i = 0; i < 300; ++i) rig.send(from, to, std::string(10'000, 'x'), {.flags = 2});
  rig.settle_without_reading();
  return static_cast<double>(rig.connection(peer)->outbox.lane(1).bytes());
}

TEST(Flusher, InALaneOfALinkWaitsWhatItTakesIn200Ms) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& slow = rig.link(0, HubId{20});
  EXPECT_NEAR(waiting_for(rig, a, slow, 100'000), Outbox::kLinkLaneBytesMin, 15'000.0);
  FakeNode& faster = rig.link(0, HubId{30});
  EXPECT_NEAR(waiting_for(rig, a, faster, 400'000), 800'000, 200'000.0);
  FakeNode& node = rig.join(0);
  EXPECT_NEAR(waiting_for(rig, a, node, 100'000), Limits{}.lane1_bytes, 15'000.0);
}

}  // namespace
}  // namespace gimnet::hub
