#include "hub/shard/keeper.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/shard/support/hub_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::DropReason;
using proto::GoodbyeCode;
using testing::FakeNode;
using testing::HubRig;
using ::testing::SizeIs;

TEST(Keeper, SaysPingAfterTheKeepAliveInterval) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  rig.pass_ms(900);
  rig.settle();
  EXPECT_THAT(a.flow_of<proto::flow::Ping>(), SizeIs(0));
  rig.pass_ms(200);
  rig.settle();
  EXPECT_THAT(a.flow_of<proto::flow::Ping>(), SizeIs(1));
  rig.pass_ms(2'000);
  rig.settle();
  EXPECT_THAT(a.flow_of<proto::flow::Ping>(), SizeIs(3));
}

TEST(Keeper, TakesLittleMemoryToTellManyAtOnce) {
  HubRig rig;
  constexpr std::size_t kNodes = 2'000;
  std::vector<FakeNode*> nodes;
  for (std::size_t i = 0; i < kNodes; ++i) nodes.push_back(&rig.join(0));
  const std::size_t before = rig.shard(0).state().pool.kept_chunk_bytes();
  rig.now_ms += 1'500;
  rig.turn_shard(0);
  EXPECT_LE(rig.shard(0).state().pool.kept_chunk_bytes() - before, 16u * 256);
  rig.settle();
  for (const FakeNode* node : nodes) EXPECT_THAT(node->flow_of<proto::flow::Ping>(), SizeIs(1));
}

TEST(Keeper, ClosesASilentNodeAtTheSilentTimeAndNotBefore) {
  HubRig rig;
  FakeNode& silent = rig.join(0);
  rig.pass_ms(2'900, false);
  rig.settle();
  EXPECT_FALSE(silent.goodbye);
  rig.pass_ms(200, false);
  rig.settle();
  ASSERT_TRUE(silent.goodbye);
  EXPECT_EQ(silent.goodbye->code, GoodbyeCode::silent);
  EXPECT_EQ(rig.sum(&ShardCounters::silent), 1u);
  EXPECT_EQ(rig.sum(&ShardCounters::connections), 0u);
  EXPECT_EQ(rig.sum(&ShardCounters::sessions), 1u) << "the session waits for its grace time";
  const auto detached = rig.take_detached();
  ASSERT_TRUE(detached);
  EXPECT_EQ(detached->code, GoodbyeCode::silent);
}

TEST(Keeper, HearsANodeThatOnlyAnswers) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  rig.pass_ms(20'000);
  rig.settle();
  EXPECT_FALSE(a.goodbye);
}

TEST(Keeper, ClosesForAFrameThatNeverEnds) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  const auto frame = HubRig::frame(a, a.id.value(), std::string(40'000, 'x'));
  // One byte a step is life, but no progress.
  std::size_t sent = 20;
  rig.write(a, std::span(frame).first(sent));
  rig.turn();
  for (int step = 0; step < 29; ++step) {
    rig.write(a, std::span(frame).subspan(sent++, 1));
    rig.pass_ms(1'000, false);
  }
  rig.settle();
  EXPECT_FALSE(a.goodbye);
  for (int step = 0; step < 2; ++step) {
    rig.write(a, std::span(frame).subspan(sent++, 1));
    rig.pass_ms(1'000, false);
  }
  rig.settle();
  ASSERT_TRUE(a.goodbye);
  EXPECT_EQ(a.goodbye->code, GoodbyeCode::stalled_frame);
  EXPECT_EQ(rig.sum(&ShardCounters::stalled_frames), 1u);
}

TEST(Keeper, AFrameDoesNotStallWhileTheHubDoesNotRead) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  const auto frame = HubRig::frame(a, a.id.value(), "hello");
  rig.write(a, std::span(frame).first(5));
  rig.turn();
  rig.state(0).signals.apply_hold(a.id, true);
  rig.pass_ms(60'000, false);
  rig.state(0).signals.apply_hold(a.id, false);
  rig.write(a, std::span(frame).subspan(5));
  rig.pass_ms(200, false);
  rig.settle();
  EXPECT_FALSE(a.goodbye);
  EXPECT_EQ(rig.sum(&ShardCounters::stalled_frames), 0u);
  EXPECT_THAT(a.frames, SizeIs(1));
}

TEST(Keeper, ANewFrameHasAllItsTime) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  const auto frame = HubRig::frame(a, a.id.value(), "hello");
  // Every read ends in the middle of another frame.
  rig.write(a, std::span(frame).first(5));
  for (int step = 0; step < 40; ++step) {
    rig.pass_ms(1'000, false);
    rig.write(a, std::span(frame).subspan(5));
    rig.write(a, std::span(frame).first(5));
    rig.turn();
  }
  rig.settle();
  EXPECT_FALSE(a.goodbye);
  EXPECT_THAT(a.frames, SizeIs(40));
}

TEST(Keeper, ConfirmsWhatItTookWithKeepAlive) {
  HubRig rig;
  FakeNode& a = rig.join(0, {.resume = true});
  FakeNode& b = rig.join(0);
  rig.send(a, b.id.value(), "one");
  rig.settle();
  EXPECT_THAT(a.flow_of<proto::flow::Confirm>(), SizeIs(0));
  rig.pass_ms(1'100);
  rig.settle();
  ASSERT_THAT(a.flow_of<proto::flow::Confirm>(), SizeIs(1));
  EXPECT_EQ(a.flow_of<proto::flow::Confirm>()[0].count, 1u);
  rig.pass_ms(1'100);
  rig.settle();
  EXPECT_THAT(a.flow_of<proto::flow::Confirm>(), SizeIs(1)) << "nothing new to confirm";
}

TEST(Keeper, ConfirmsWhatItTookWhenAsked) {
  HubRig rig;
  FakeNode& a = rig.join(0, {.resume = true});
  FakeNode& b = rig.join(0);
  rig.send(a, b.id.value(), "one");
  rig.send_flow(a, proto::flow::Ping{});
  rig.settle();
  ASSERT_THAT(a.flow_of<proto::flow::Confirm>(), SizeIs(1));
  EXPECT_EQ(a.flow_of<proto::flow::Confirm>()[0].count, 1u);
  rig.send_flow(a, proto::flow::Ping{});
  rig.settle();
  EXPECT_THAT(a.flow_of<proto::flow::Confirm>(), SizeIs(1)) << "nothing new to confirm";
}

TEST(Keeper, SaysAConfirmLaterThatFoundNoRoom) {
  Limits limits;
  limits.control_bytes = 16 * 1024;
  for (const bool asks : {true, false}) {
    HubRig rig(1, limits);
    FakeNode& a = rig.join(0, {.resume = true});
    FakeNode& b = rig.join(0);
    a.pipe.set_room(0);
    for (int i = 0; i < 2'000; ++i) rig.send_flow(a, proto::flow::Ping{});
    rig.send(a, b.id.value(), "one");
    rig.send_flow(a, proto::flow::Ping{});
    rig.settle();
    EXPECT_THAT(b.frames, SizeIs(1));
    a.pipe.set_room(MemoryPeer::kAll);
    rig.settle();
    EXPECT_GE(a.flow().size(), 400u) << "as many as there is room for";
    EXPECT_LT(a.flow().size(), 2'000u);
    EXPECT_THAT(a.flow_of<proto::flow::Confirm>(), SizeIs(0));
    if (asks) {
      rig.send_flow(a, proto::flow::Ping{});
    } else {
      rig.pass_ms(1'100);
    }
    rig.settle();
    ASSERT_THAT(a.flow_of<proto::flow::Confirm>(), SizeIs(1)) << "asks " << asks;
    EXPECT_EQ(a.flow_of<proto::flow::Confirm>()[0].count, 1u);
  }
}

TEST(Keeper, ConfirmsAtAQuarterOfThePeersBuffer) {
  HubRig rig;
  FakeNode& a = rig.join(0, {.resume = true, .resume_bytes = 4'000});
  FakeNode& b = rig.join(0);
  rig.send(a, b.id.value(), std::string(1'000 - proto::kHeaderSize - 1, 'x'));
  rig.settle();
  EXPECT_THAT(a.flow_of<proto::flow::Confirm>(), SizeIs(0));
  rig.send(a, b.id.value(), "");
  rig.settle();
  ASSERT_THAT(a.flow_of<proto::flow::Confirm>(), SizeIs(1));
  EXPECT_EQ(a.flow_of<proto::flow::Confirm>()[0].count, 2u);
}

/// The shard said that it is drained; whatever ended meanwhile ended for that.
bool drained(HubRig& rig) {
  bool said = false;
  for (const ShardEvent& event : rig.take_events()) {
    if (std::holds_alternative<DrainedEvent>(event.what)) said = true;
    const auto* detached = std::get_if<DetachedEvent>(&event.what);
    if (detached == nullptr) continue;
    EXPECT_EQ(detached->code, GoodbyeCode::draining);
  }
  return said;
}

TEST(Keeper, DrainsAtOnceWhereNothingWaits) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  rig.command(0, DrainCommand{10'000});
  rig.settle();
  ASSERT_TRUE(a.goodbye);
  EXPECT_EQ(a.goodbye->code, GoodbyeCode::draining);
  EXPECT_TRUE(drained(rig));
  rig.pass_ms(1'000);
  EXPECT_FALSE(drained(rig)) << "told once";
}

TEST(Keeper, DrainsAnEmptyShard) {
  HubRig rig;
  rig.command(0, DrainCommand{10'000});
  rig.turn();
  EXPECT_TRUE(drained(rig));
}

// The command comes to each shard in its own time: what another one has taken until then is still
// written.
TEST(Keeper, ClosesNobodyBeforeAllShardsDrain) {
  HubRig rig(2);
  FakeNode& a = rig.join(1);
  FakeNode& b = rig.join(0);
  rig.command(0, DrainCommand{10'000});
  rig.turn_shard(0);
  rig.send(a, b.id.value(), "taken before its shard was told");
  rig.turn_shard(1);
  rig.turn_shard(0);
  EXPECT_FALSE(b.pipe.transport_gone());
  rig.command(1, DrainCommand{10'000});
  rig.send(a, b.id.value(), "not read any more");
  rig.turn_shard(1);
  rig.turn_shard(0);
  b.read();
  EXPECT_EQ(b.texts(), std::vector<std::string>{"taken before its shard was told"});
  EXPECT_TRUE(b.goodbye);
  rig.settle();
  EXPECT_EQ(a.goodbye ? a.goodbye->code : GoodbyeCode::done, GoodbyeCode::draining);
  EXPECT_TRUE(a.pipe.transport_readable());
  EXPECT_EQ(rig.ledger().dropped, 0u);
}

TEST(Keeper, IsNotDrainedBeforeAllShardsDrain) {
  HubRig rig(3);
  for (const std::size_t shard : {2u, 0u}) {
    rig.command(shard, DrainCommand{10'000});
    rig.settle();
    EXPECT_FALSE(drained(rig)) << "shard 1 was not told yet";
  }
  rig.command(1, DrainCommand{10'000});
  rig.settle();
  std::size_t told = 0;
  for (const ShardEvent& event : rig.take_events())
    told += std::holds_alternative<DrainedEvent>(event.what) ? 1 : 0;
  EXPECT_EQ(told, 3u);
}

// Without its CONFIRM nothing more could be written to it.
TEST(Keeper, DrainsANodeThatHasToConfirm) {
  Limits limits;
  limits.resume_bytes = 4'096;
  HubRig rig(1, limits);
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0, {.resume = true});
  for (int i = 0; i < 10; ++i) rig.send(a, b.id.value(), std::string(1'000, 'x'));
  rig.settle();
  EXPECT_LT(b.frames.size(), 10u);
  rig.command(0, DrainCommand{60'000});
  for (int i = 0; i < 10 && !b.pipe.transport_gone(); ++i) {
    rig.send_flow(b, proto::flow::Confirm{b.data_frames});
    rig.settle();
  }
  EXPECT_THAT(b.frames, SizeIs(10));
  EXPECT_TRUE(b.goodbye);
  EXPECT_EQ(rig.dropped(DropReason::link_lost), 0u);
}

// Such a node is read for its CONFIRM while others are closed already: what it sends meanwhile
// stays its own.
TEST(Keeper, TakesNoDataOfANodeThatHasToConfirmAtTheEnd) {
  for (const std::size_t shard : {0u, 1u}) {
    Limits limits;
    limits.resume_bytes = 4'096;
    HubRig rig(2, limits);
    FakeNode& flooder = rig.join(0);
    FakeNode& confirmer = rig.join(0, {.resume = true});
    FakeNode& receiver = rig.join(shard);
    rig.send(confirmer, receiver.id.value(), "taken");
    for (int i = 0; i < 6; ++i) rig.send(flooder, confirmer.id.value(), std::string(1'000, 'x'));
    rig.settle();
    ASSERT_LT(confirmer.frames.size(), 6u) << "the rest waits for a CONFIRM";
    for (const std::size_t each : {0u, 1u}) rig.command(each, DrainCommand{60'000});
    rig.turn();
    const std::uint64_t accepted = rig.ledger().accepted;
    for (const char* text : {"behind", "the last word"})
      rig.send(confirmer, receiver.id.value(), text);
    rig.send_flow(confirmer, proto::flow::Skip{DropReason::replaced, 3});
    rig.send_flow(confirmer, proto::flow::Ping{});
    rig.send_flow(confirmer, proto::flow::Confirm{confirmer.data_frames});
    for (int i = 0; i < 10 && !confirmer.pipe.transport_gone(); ++i) {
      rig.settle();
      if (!confirmer.pipe.transport_gone())
        rig.send_flow(confirmer, proto::flow::Confirm{confirmer.data_frames});
    }
    EXPECT_THAT(confirmer.frames, SizeIs(6)) << "its CONFIRMs were read";
    EXPECT_TRUE(confirmer.goodbye);
    EXPECT_EQ(receiver.texts(), std::vector<std::string>{"taken"});
    EXPECT_EQ(rig.ledger().accepted, accepted);
    EXPECT_EQ(rig.ledger().dropped, 0u);
    EXPECT_EQ(rig.sum(&ShardCounters::untaken_frames), 2u);
    const auto confirms = confirmer.flow_of<proto::flow::Confirm>();
    ASSERT_FALSE(confirms.empty());
    EXPECT_EQ(confirms.back().count, 1u) << "it knows that the others were not taken";
  }
}

TEST(Keeper, DoesNotWaitForOtherShardsBeyondItsDeadline) {
  HubRig rig(2);
  FakeNode& a = rig.join(0);
  rig.command(0, DrainCommand{2'000});
  rig.pass_ms(1'900);
  EXPECT_FALSE(a.pipe.transport_gone());
  EXPECT_FALSE(drained(rig));
  rig.pass_ms(200);
  EXPECT_TRUE(a.pipe.transport_gone());
  EXPECT_TRUE(drained(rig));
}

// A frame of which the first bytes are with the kernel is finished, however long its reader takes.
TEST(Keeper, DrainsASlowReaderToTheLastByte) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& slow = rig.join(0);
  slow.pipe.set_room(100);
  const std::string payload(1'000, 'x');
  rig.send(a, slow.id.value(), payload);
  rig.send(a, slow.id.value(), payload);
  rig.turn();
  rig.command(0, DrainCommand{60'000});
  for (int step = 0; step < 40 && !slow.pipe.transport_gone(); ++step) {
    rig.pass_ms(200, false);  // a drained connection is not read, so it can't be silent either
    slow.read(90);
  }
  slow.read();
  EXPECT_THAT(slow.frames, SizeIs(2));
  EXPECT_TRUE(drained(rig));
  EXPECT_EQ(rig.ledger().dropped, 0u);
}

TEST(Keeper, EndsADrainAtItsDeadline) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& stopped = rig.join(0);
  stopped.pipe.set_room(0);
  rig.send(a, stopped.id.value(), "never read");
  rig.settle_without_reading();
  rig.command(0, DrainCommand{2'000});
  rig.pass_ms(1'900);
  EXPECT_FALSE(stopped.pipe.transport_gone());
  rig.pass_ms(300);
  EXPECT_TRUE(stopped.pipe.transport_gone());
  EXPECT_TRUE(drained(rig));
  EXPECT_EQ(rig.dropped(DropReason::link_lost), 1u);
}

}  // namespace
}  // namespace gimnet::hub
