#include "hub/data/egress/outbox.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/frame/extensions.hpp"
#include "tests/hub/data/support/egress_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::DropReason;
using proto::Kind;
using testing::EgressRig;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using testing::TestConnection;
using testing::TestFrame;

constexpr std::uint8_t kDrop = 2;
constexpr std::uint8_t kLatest = 3 | proto::kFlagKeyed;
constexpr std::uint32_t kKiB = 1024;

Limits small_limits() {
  Limits limits;
  limits.lane0_bytes = limits.lane1_bytes = limits.lane2_bytes = limits.lane3_bytes = 16 * kKiB;
  limits.reserve_bytes = 16 * kKiB;
  return limits;
}

/// A payload that makes a frame of exactly `size` bytes.
std::string sized(std::uint32_t size, char fill = 'x') {
  return std::string(size - proto::kHeaderSize, fill);
}

/// The connection takes nothing, and what is in the outbox waits.
void block(TestConnection& connection) {
  connection.peer.set_room(0);
  connection.rig.push(connection.outbox, "first", {.lane = 3});
  EXPECT_EQ(connection.flush(), Flush::blocked);
}

TEST(Outbox, TakesAndGivesFramesInOrder) {
  EgressRig rig;
  TestConnection connection(rig);
  rig.push(connection.outbox, "one");
  rig.push(connection.outbox, "two");
  EXPECT_FALSE(connection.outbox.empty());
  EXPECT_EQ(connection.flush(), Flush::emptied);
  EXPECT_THAT(connection.take(), ElementsAre("one", "two"));
  EXPECT_TRUE(connection.outbox.empty());
  EXPECT_TRUE(rig.ledger_exact());
}

TEST(Outbox, BlockPausesOnceHoldsPastTheReserveAndLetsGo) {
  EgressRig rig(small_limits());
  TestConnection connection(rig);
  block(connection);
  for (int i = 0; i < 8; ++i) rig.push(connection.outbox, sized(kKiB));
  EXPECT_THAT(rig.signals.take(), IsEmpty()) << "exactly half of the lane";
  rig.push(connection.outbox, "");
  EXPECT_THAT(rig.signals.take(), ElementsAre("pause 1"));
  for (int i = 0; i < 15; ++i) rig.push(connection.outbox, sized(kKiB));
  EXPECT_THAT(rig.signals.take(), IsEmpty()) << "within the reserve";
  for (int i = 0; i < 4; ++i) rig.push(connection.outbox, sized(kKiB), {.src = 2});
  EXPECT_THAT(rig.signals.take(), IsEmpty()) << "within its share, half of what BLOCK may have";
  rig.push(connection.outbox, sized(kKiB), {.src = 2});
  EXPECT_THAT(rig.signals.take(), ElementsAre("pause 2", "hold 2"));
  rig.push(connection.outbox, "", {.src = 1});
  EXPECT_THAT(rig.signals.take(), ElementsAre("hold 1"));
  EXPECT_EQ(rig.tally.queued, 1 + 8 + 1 + 15 + 5 + 1);
  connection.peer.set_room(MemoryPeer::kAll);
  connection.flush();
  EXPECT_THAT(rig.signals.take(), ElementsAre("resume 1", "release 1", "resume 2", "release 2"));
  EXPECT_TRUE(rig.ledger_exact());
}

TEST(Outbox, RemindsASenderThatGoesOn) {
  EgressRig rig(small_limits());
  TestConnection connection(rig);
  block(connection);
  for (int i = 0; i < 8 + 1; ++i) rig.push(connection.outbox, sized(kKiB));
  rig.signals.take();
  for (int i = 0; i < 256; ++i) rig.push(connection.outbox, sized(kKiB));
  EXPECT_THAT(rig.signals.take(), ElementsAre("hold 1", "pause 1"));
}

TEST(Outbox, RoomIsToldAtAQuarterOfTheLane) {
  EgressRig rig(small_limits());
  TestConnection connection(rig);
  block(connection);
  for (int i = 0; i < 9; ++i) rig.push(connection.outbox, sized(kKiB));
  rig.signals.take();
  connection.peer.set_room(4 * kKiB);
  connection.flush();
  EXPECT_THAT(rig.signals.take(), IsEmpty()) << "5 KiB still wait";
  connection.take();
  connection.peer.set_room(1 * kKiB);
  connection.flush();
  EXPECT_THAT(rig.signals.take(), ElementsAre("resume 1"));
}

TEST(Outbox, LatestReplacesInPlace) {
  EgressRig rig;
  TestConnection connection(rig);
  block(connection);
  rig.push(connection.outbox, "key____1 old", {.flags = kLatest});
  rig.push(connection.outbox, "key____2 other key", {.flags = kLatest});
  rig.push(connection.outbox, "key____1 other source", {.flags = kLatest, .src = 2});
  rig.push(connection.outbox, "key____1 other lane", {.flags = kLatest, .lane = 2});
  rig.push(connection.outbox, "key____1 newer", {.flags = kLatest});
  rig.push(connection.outbox, "key____1 newest", {.flags = kLatest});
  EXPECT_EQ(rig.dropped(DropReason::replaced), 2u);
  connection.peer.set_room(MemoryPeer::kAll);
  connection.flush();
  EXPECT_THAT(connection.take(),
              ElementsAre("key____1 newest", "key____2 other key", "key____1 other source",
                          "key____1 other lane", "first"));
  EXPECT_TRUE(rig.ledger_exact());
}

// While the connection takes all that comes nobody looks for older ones; once it does not, the
// newest are what waits.
TEST(Outbox, LatestOfOneBurstIsReplacedWhenItHasToWait) {
  EgressRig rig;
  TestConnection connection(rig);
  rig.push(connection.outbox, "key____1 begun", {.flags = kLatest});
  rig.push(connection.outbox, "key____1 old", {.flags = kLatest});
  rig.push(connection.outbox, "key____2 old", {.flags = kLatest});
  rig.push(connection.outbox, "key____1 other lane", {.flags = kLatest, .lane = 2});
  rig.push(connection.outbox, "plain");
  rig.push(connection.outbox, "key____2 new", {.flags = kLatest});
  rig.push(connection.outbox, "key____1 newer", {.flags = kLatest});
  rig.push(connection.outbox, "plain again", {.src = 2});
  connection.peer.set_room(20);
  connection.flush();
  EXPECT_EQ(rig.dropped(DropReason::replaced), 2u);
  EXPECT_TRUE(rig.ledger_exact());
  rig.push(connection.outbox, "key____1 newest", {.flags = kLatest});
  EXPECT_EQ(rig.dropped(DropReason::replaced), 3u);
  connection.peer.set_room(MemoryPeer::kAll);
  connection.flush();
  EXPECT_THAT(connection.take(), ElementsAre("key____1 begun", "key____1 newest", "key____2 new",
                                             "plain", "plain again", "key____1 other lane"));
  EXPECT_TRUE(rig.ledger_exact());
  EXPECT_EQ(rig.tally.queued, 0);
}

TEST(Outbox, ALatestMessageOfABurstThatIsReplacedGoesWithItsRest) {
  EgressRig rig;
  TestConnection connection(rig);
  const auto fragment = [&](std::uint32_t number, std::uint32_t offset) {
    rig.push_fragment(connection.outbox, number, offset, 24,
                      "key____1" + std::string(8, static_cast<char>('0' + number)),
                      {.kind = Kind::group, .flags = kLatest});
  };
  connection.peer.set_room(0);
  fragment(1, 0);
  fragment(1, 8);
  fragment(2, 0);
  connection.flush();
  EXPECT_EQ(rig.dropped(DropReason::replaced), 2u);
  fragment(1, 16);
  fragment(2, 8);
  fragment(2, 16);
  EXPECT_EQ(rig.dropped(DropReason::cut_message), 1u);
  connection.peer.set_room(MemoryPeer::kAll);
  connection.flush();
  EXPECT_THAT(connection.take(), SizeIs(3));
  EXPECT_TRUE(rig.ledger_exact());
}

TEST(Outbox, LatestOfAMessageUnderWayIsNotReplaced) {
  EgressRig rig;
  TestConnection connection(rig);
  connection.peer.set_room(0);
  const auto fragment = [&](std::uint32_t number, std::uint32_t offset) {
    rig.push_fragment(connection.outbox, number, offset, 16,
                      "key____1" + std::string(8, static_cast<char>('0' + number)),
                      {.kind = Kind::group, .flags = kLatest});
  };
  fragment(1, 0);
  connection.flush();
  connection.peer.set_room(proto::kHeaderSize);  // message 1 is begun
  connection.flush();
  fragment(1, 8);
  fragment(2, 0);
  fragment(3, 0);  // replaces 2, of which the rest is refused
  fragment(2, 8);
  fragment(3, 8);
  EXPECT_EQ(rig.dropped(DropReason::replaced), 1u);
  EXPECT_EQ(rig.dropped(DropReason::cut_message), 1u);
  connection.peer.set_room(MemoryPeer::kAll);
  connection.flush();
  const auto texts = connection.take();
  ASSERT_THAT(texts, SizeIs(4));
  EXPECT_EQ(texts[0].substr(0, 4), "1:0:");
  EXPECT_EQ(texts[1].substr(0, 4), "1:8:");
  EXPECT_EQ(texts[2].substr(0, 4), "3:0:");
  EXPECT_EQ(texts[3].substr(0, 4), "3:8:");
  EXPECT_TRUE(rig.ledger_exact());
}

// A message that replaced an older one waits like it: counted against the budget, and out of its
// slab if it is small.
TEST(Outbox, WhatReplacedAnOlderMessageIsSettledToo) {
  EgressRig rig;
  TestConnection connection(rig);
  block(connection);
  rig.push(connection.outbox, "key____1" + std::string(2'000, 'a'), {.flags = kLatest});
  rig.push(connection.outbox, "behind it");
  connection.flush();
  rig.push(connection.outbox, "key____1" + std::string(40'000, 'b'), {.flags = kLatest});
  connection.flush();
  const hub::Run& waiting = connection.outbox.lane(1).front().run;
  EXPECT_EQ(waiting.buffer->payer, &rig.lease);
  rig.push(connection.outbox, "key____1" + std::string(3'000, 'c'), {.flags = kLatest});
  connection.flush();
  EXPECT_EQ(connection.outbox.lane(1).front().run.buffer->kind, BufferKind::chunk);
  EXPECT_EQ(connection.outbox.lane(1).front().run.buffer->payer, &rig.lease);
}

TEST(Outbox, FragmentsOfOneMessageAreDroppedTogether) {
  EgressRig rig(small_limits());
  TestConnection connection(rig);
  block(connection);
  rig.push_fragment(connection.outbox, 1, 0, 9'000, std::string(3'000, 'a'), {.kind = Kind::group});
  rig.push_fragment(connection.outbox, 1, 3'000, 9'000, std::string(3'000, 'a'),
                    {.kind = Kind::group});
  for (int i = 0; i < 11; ++i) rig.push(connection.outbox, sized(kKiB, 'g'), {.kind = Kind::group});
  EXPECT_EQ(rig.dropped(DropReason::queue_full), 2u) << "both fragments that wait";
  rig.push_fragment(connection.outbox, 1, 6'000, 9'000, std::string(3'000, 'a'),
                    {.kind = Kind::group});
  EXPECT_EQ(rig.dropped(DropReason::cut_message), 1u) << "and the one that comes";
  // The number is free again.
  rig.push_fragment(connection.outbox, 1, 0, 20, std::string(10, 'n'),
                    {.kind = Kind::group, .lane = 2});
  rig.push_fragment(connection.outbox, 1, 10, 20, std::string(10, 'n'),
                    {.kind = Kind::group, .lane = 2});
  EXPECT_EQ(rig.dropped(DropReason::cut_message), 1u);
  EXPECT_TRUE(rig.ledger_exact());
}

// A sender that begins its numbers anew, or never ends a message that was cut.
TEST(Outbox, ANewMessageUnderTheNumberOfACutOneArrives) {
  EgressRig rig(small_limits());
  TestConnection connection(rig);
  block(connection);
  rig.push_fragment(connection.outbox, 1, 0, 9'000, std::string(3'000, 'a'), {.kind = Kind::group});
  for (int i = 0; i < 16; ++i) rig.push(connection.outbox, sized(kKiB, 'g'), {.kind = Kind::group});
  EXPECT_GE(rig.dropped(DropReason::queue_full), 1u);
  rig.push_fragment(connection.outbox, 1, 0, 20, std::string(10, 'n'),
                    {.kind = Kind::group, .lane = 2});
  rig.push_fragment(connection.outbox, 1, 10, 20, std::string(10, 'n'),
                    {.kind = Kind::group, .lane = 2});
  EXPECT_EQ(rig.dropped(DropReason::cut_message), 0u);
}

TEST(Outbox, AMessageUnderWayIsFinishedOverItsLimit) {
  EgressRig rig(small_limits());
  TestConnection connection(rig);
  connection.peer.set_room(proto::kHeaderSize);
  rig.push_fragment(connection.outbox, 1, 0, 40'000, std::string(8'000, 'a'), {.flags = kDrop});
  connection.flush();
  for (std::uint32_t offset = 8'000; offset < 40'000; offset += 8'000) {
    rig.push_fragment(connection.outbox, 1, offset, 40'000, std::string(8'000, 'a'),
                      {.flags = kDrop});
  }
  EXPECT_EQ(rig.tally.any_dropped, false);
  connection.peer.set_room(MemoryPeer::kAll);
  connection.flush();
  EXPECT_THAT(connection.take(), SizeIs(5));
}

TEST(Outbox, RefusesWhatWouldWaitOverTheBudget) {
  Limits limits;
  limits.budget_bytes = 4 << 20;
  EgressRig rig(limits);
  std::vector<std::unique_ptr<TestConnection>> connections;
  for (int i = 0; i < 40; ++i) connections.push_back(std::make_unique<TestConnection>(rig));
  for (const auto& connection : connections) {
    block(*connection);
    for (int i = 0; i < 20; ++i) {
      rig.push(connection->outbox, sized(20 * kKiB), {.kind = Kind::group});
      connection->flush();
    }
  }
  EXPECT_GT(rig.dropped(DropReason::over_budget), 100u);
  EXPECT_LE(rig.pool.pinned_bytes(), (4u << 20) * 11 / 10);
  EXPECT_TRUE(rig.ledger_exact());
  const std::uint64_t pinned = rig.pool.pinned_bytes();
  connections.clear();
  EXPECT_LT(rig.pool.pinned_bytes(), pinned);
  EXPECT_EQ(rig.tally.queued, 0);
  EXPECT_TRUE(rig.ledger_exact());
}

TEST(Outbox, TimeOutDropsBlockAndLeavesTheRest) {
  EgressRig rig(small_limits());
  TestConnection connection(rig);
  block(connection);
  for (int i = 0; i < 17; ++i) rig.push(connection.outbox, sized(kKiB, 'b'));
  rig.push(connection.outbox, "group", {.kind = Kind::group, .lane = 2});
  EXPECT_TRUE(connection.outbox.has_block());
  connection.outbox.time_out_block(rig.context);
  EXPECT_EQ(rig.dropped(DropReason::timed_out), 18u) << "all 17, and the one in lane 3";
  EXPECT_FALSE(connection.outbox.has_block());
  EXPECT_THAT(rig.signals.take(), ElementsAre("pause 1", "resume 1"));
  connection.peer.set_room(MemoryPeer::kAll);
  connection.flush();
  EXPECT_THAT(connection.take(), ElementsAre("group"));
  EXPECT_TRUE(rig.ledger_exact());
}

TEST(Outbox, SmallWaitingFramesLeaveTheirSlab) {
  EgressRig rig;
  TestConnection connection(rig);
  block(connection);
  rig.push(connection.outbox, sized(6 * kKiB));
  EXPECT_EQ(connection.outbox.lane(1).front().run.buffer->kind, BufferKind::slab);
  rig.push(connection.outbox, sized(6 * kKiB),
           {.lane = 0});  // so that the first is not the last entry
  connection.flush();
  rig.push(connection.outbox, sized(6 * kKiB), {.src = 2});
  connection.flush();
  EXPECT_EQ(connection.outbox.lane(1).front().run.buffer->kind, BufferKind::chunk);
}

TEST(Outbox, FanOutKeepsAReferenceHoweverSmall) {
  EgressRig rig;
  TestConnection connection(rig);
  const std::uint64_t copied = rig.tally.copied_bytes;
  rig.push(connection.outbox, "small", {.kind = Kind::group}, true);
  EXPECT_EQ(rig.tally.copied_bytes, copied);
  rig.push(connection.outbox, "small", {.kind = Kind::group}, false);
  EXPECT_EQ(rig.tally.copied_bytes, copied + 21);
}

TEST(Outbox, DropAllLeavesNothing) {
  EgressRig rig(small_limits());
  TestConnection connection(rig);
  block(connection);
  for (int i = 0; i < 40; ++i) rig.push(connection.outbox, sized(kKiB));
  rig.push_fragment(connection.outbox, 1, 0, 100, "part", {.lane = 2});
  connection.outbox.drop_all(DropReason::link_lost, rig.context);
  EXPECT_TRUE(connection.outbox.empty());
  EXPECT_EQ(rig.tally.queued, 0);
  EXPECT_THAT(rig.signals.take(), ElementsAre("pause 1", "hold 1", "resume 1", "release 1"));
  EXPECT_TRUE(rig.ledger_exact());
}

TEST(Outbox, AnAgedFrameIsDroppedWhenItsTurnComes) {
  EgressRig rig;
  TestConnection connection(rig);
  block(connection);
  std::byte memory[64];
  proto::ExtensionWriter writer(memory);
  ASSERT_TRUE(writer.add_age({rig.context.now_wall_ns, 50}));
  const auto bytes = writer.written();
  std::string text(2, '\0');
  text[0] = static_cast<char>(bytes.size());
  text.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  rig.push(connection.outbox, text + "aged", {.flags = proto::kFlagExt});
  rig.push(connection.outbox, "young");
  connection.flush();
  rig.context.now_wall_ns += 51'000'000;
  connection.peer.set_room(MemoryPeer::kAll);
  connection.flush();
  EXPECT_THAT(connection.take(), ElementsAre("young", "first"));
  EXPECT_EQ(rig.dropped(DropReason::too_old), 1u);
  EXPECT_TRUE(rig.ledger_exact());
}

}  // namespace
}  // namespace gimnet::hub
