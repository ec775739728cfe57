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

constexpr std::uint8_t kBlock = 1;
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

TEST(FullOutbox, DropRefusesTheNewMessageOneByteBeyondTheLimit) {
  EgressRig rig(small_limits());
  TestConnection connection(rig);
  block(connection);
  for (int i = 0; i < 16; ++i) rig.push(connection.outbox, sized(kKiB), {.flags = kDrop});
  EXPECT_EQ(rig.dropped(DropReason::queue_full), 0u) << "exactly the limit";
  rig.push(connection.outbox, "", {.flags = kDrop});
  EXPECT_EQ(rig.dropped(DropReason::queue_full), 1u);
  rig.push(connection.outbox, "another lane has room", {.flags = kDrop, .lane = 2});
  EXPECT_EQ(rig.dropped(DropReason::queue_full), 1u);
  EXPECT_TRUE(rig.ledger_exact());
}

// A chunk filled with what was refused would stay for the sake of one message that was not.
TEST(FullOutbox, WhatIsRefusedTakesNoMemory) {
  for (const std::uint32_t size : {100u, 900u, 3'000u}) {
    EgressRig rig(small_limits());
    TestConnection connection(rig);
    block(connection);
    while (rig.dropped(DropReason::queue_full) == 0)
      rig.push(connection.outbox, sized(size), {.flags = kDrop});
    connection.outbox.settle(rig.context);
    const std::uint64_t copied = rig.tally.copied_bytes;
    const std::uint64_t pinned = rig.pool.pinned_bytes();
    for (int i = 0; i < 1'000; ++i) rig.push(connection.outbox, sized(size), {.flags = kDrop});
    connection.outbox.settle(rig.context);
    EXPECT_EQ(rig.tally.copied_bytes, copied) << size;
    EXPECT_EQ(rig.pool.pinned_bytes(), pinned) << size;
    EXPECT_EQ(rig.dropped(DropReason::queue_full), 1'001u);
    EXPECT_TRUE(rig.ledger_exact());
  }
}

TEST(FullOutbox, ABurstIsTakenOrRefusedWhole) {
  const std::vector<std::string> burst(4, sized(kKiB));
  for (const std::uint32_t waiting : {12u, 13u}) {
    EgressRig rig(small_limits());
    TestConnection connection(rig);
    block(connection);
    rig.push(connection.outbox, sized(waiting * kKiB), {.flags = kDrop, .src = 2});
    const hub::Run run = rig.run(burst, {.flags = kDrop});
    connection.outbox.push(run, run.header(), {}, rig.context);
    EXPECT_EQ(rig.dropped(DropReason::queue_full), waiting == 12 ? 0u : 4u);
    EXPECT_TRUE(rig.ledger_exact());
  }
}

TEST(FullOutbox, AWaitingBurstMakesRoomWhole) {
  EgressRig rig(small_limits());
  TestConnection connection(rig);
  block(connection);
  std::uint32_t src = 0;
  for (const std::size_t messages : {3u, 5u, 4u, 4u}) {
    const hub::Run run = rig.run(std::vector<std::string>(messages, sized(kKiB)),
                                 {.kind = Kind::group, .src = ++src});
    connection.outbox.push(run, run.header(), {.fan_out = true}, rig.context);
  }
  EXPECT_FALSE(rig.tally.any_dropped);
  rig.push(connection.outbox, "", {.kind = Kind::group, .src = 5});
  EXPECT_EQ(rig.dropped(DropReason::queue_full), 5u) << "of the source with the most";
  EXPECT_EQ(connection.outbox.lane(1).front().run.header().src, 7u << 20 | 1);
  EXPECT_TRUE(rig.ledger_exact());
}

// A source whose one burst is longer than the lane.
TEST(FullOutbox, ABurstLargerThanItsLaneMayWaitAlone) {
  EgressRig rig(small_limits());
  TestConnection connection(rig);
  block(connection);
  for (int i = 0; i < 2; ++i) {
    const hub::Run run =
        rig.run(std::vector<std::string>(20, sized(kKiB)), {.kind = Kind::group, .dst = 1});
    connection.outbox.push(run, run.header(), {.fan_out = true}, rig.context);
    static_cast<void>(rig.run({"between"}));
    --rig.accepted;
  }
  EXPECT_EQ(rig.dropped(DropReason::queue_full), 20u);
  EXPECT_EQ(connection.outbox.lane(1).bytes(), 20 * kKiB);
  EXPECT_TRUE(rig.ledger_exact());
}

TEST(FullOutbox, GroupDropsTheOldestForTheNewest) {
  EgressRig rig(small_limits());
  TestConnection connection(rig);
  block(connection);
  std::uint32_t dst = 1;  // so that none joins the one before it
  for (char c = 'a'; c < 'a' + 16; ++c)
    rig.push(connection.outbox, sized(kKiB, c), {.kind = Kind::group, .dst = ++dst});
  EXPECT_EQ(rig.dropped(DropReason::queue_full), 0u);
  rig.push(connection.outbox, sized(2 * kKiB, 'z'), {.kind = Kind::group});
  EXPECT_EQ(rig.dropped(DropReason::queue_full), 2u) << "as many of the oldest as it takes";
  connection.peer.set_room(MemoryPeer::kAll);
  connection.flush();
  auto texts = connection.take();
  std::erase(texts, "first");  // of another lane
  ASSERT_THAT(texts, SizeIs(15));
  EXPECT_EQ(texts[0][0], 'c');
  EXPECT_EQ(texts[14][0], 'z');
  EXPECT_TRUE(rig.ledger_exact());
}

TEST(FullOutbox, OldestNeverDropsBlock) {
  EgressRig rig(small_limits());
  TestConnection connection(rig);
  block(connection);
  for (int i = 0; i < 16; ++i) rig.push(connection.outbox, sized(kKiB, 'b'), {.flags = kBlock});
  rig.push(connection.outbox, sized(9 * kKiB, 'g'), {.kind = Kind::group});
  EXPECT_EQ(rig.dropped(DropReason::queue_full), 1u)
      << "the new one, since there is no older one to drop";
  connection.peer.set_room(MemoryPeer::kAll);
  connection.flush();
  for (const std::string& text : connection.take()) EXPECT_NE(text[0], 'g');
}

// However much came of BLOCK before its senders heeded PAUSE.
TEST(FullOutbox, BlockLeavesHalfOfTheLaneToOthers) {
  EgressRig rig(small_limits());
  TestConnection connection(rig);
  block(connection);
  for (int i = 0; i < 20; ++i) rig.push(connection.outbox, sized(kKiB, 'b'), {.flags = kBlock});
  EXPECT_THAT(rig.signals.take(), ElementsAre("pause 1"));
  for (int i = 0; i < 8; ++i)
    rig.push(connection.outbox, sized(kKiB, 'g'), {.kind = Kind::group, .src = 2});
  EXPECT_FALSE(rig.tally.any_dropped);
  rig.push(connection.outbox, "", {.kind = Kind::group, .src = 2});
  EXPECT_EQ(rig.dropped(DropReason::queue_full), 1u) << "one beyond it";
  connection.outbox.tell_losses([](const proto::flow::Dropped& losses) {
    EXPECT_EQ(losses.source, (NodeId{7u << 20 | 1}));
    return true;
  });
  EXPECT_TRUE(rig.ledger_exact());
}

TEST(FullOutbox, ALaneFullOfOthersTakesHalfOfItAgainInBlock) {
  EgressRig rig(small_limits());
  TestConnection connection(rig);
  block(connection);
  for (std::uint32_t i = 0; i < 16; ++i)
    rig.push(connection.outbox, sized(kKiB), {.kind = Kind::group, .dst = 1 + i});
  for (int i = 0; i < 8; ++i) rig.push(connection.outbox, sized(kKiB), {.flags = kBlock});
  EXPECT_THAT(rig.signals.take(), IsEmpty());
  EXPECT_FALSE(rig.tally.any_dropped);
  rig.push(connection.outbox, sized(kKiB), {.kind = Kind::group});
  EXPECT_EQ(rig.dropped(DropReason::queue_full), 1u) << "behind so much of BLOCK the new one";
  rig.push(connection.outbox, sized(kKiB), {.kind = Kind::group, .src = 2});
  EXPECT_EQ(rig.dropped(DropReason::queue_full), 10u) << "down to the half that is left to them";
  EXPECT_TRUE(rig.ledger_exact());
}

// Frames of a message under way wait in the order in which they came: others are not held up until
// it ends.
TEST(FullOutbox, WhatCameBeforeTheRestOfAMessageUnderWayGoesBeforeIt) {
  EgressRig rig;
  TestConnection connection(rig);
  const auto fragment = [&](std::uint32_t offset) {
    rig.push_fragment(connection.outbox, 1, offset, 100'000, std::string(10, 'a'));
  };
  block(connection);
  fragment(0);
  rig.push(connection.outbox, "behind a message that was not begun", {.src = 2});
  fragment(10);
  fragment(20);
  connection.peer.set_room(proto::kHeaderSize);
  connection.flush();
  rig.push(connection.outbox, "one", {.src = 2});
  fragment(30);
  fragment(40);
  rig.push(connection.outbox, "two", {.src = 2});
  fragment(50);
  connection.peer.set_room(MemoryPeer::kAll);
  connection.flush();
  const std::string ten(10, 'a');
  EXPECT_THAT(
      connection.take(),
      ElementsAre("1:0:" + ten, "1:10:" + ten, "1:20:" + ten, "behind a message that was not begun",
                  "one", "1:30:" + ten, "1:40:" + ten, "two", "1:50:" + ten, "first"));
  EXPECT_TRUE(rig.ledger_exact());
}

TEST(FullOutbox, TheRestOfAMessageUnderWayPausesItsSenderBeyondTheLimit) {
  EgressRig rig(small_limits());
  TestConnection connection(rig);
  rig.push_fragment(connection.outbox, 1, 0, 100'000, std::string(8'000, 'a'));
  block(connection);
  for (std::uint32_t i = 0; i < 5; ++i) {
    rig.push_fragment(connection.outbox, 1, 8'000 * (i + 1), 100'000, std::string(8'000, 'a'));
    rig.push(connection.outbox, "between", {.src = 2});
    if (i == 0) {
      EXPECT_THAT(rig.signals.take(), ElementsAre("pause 1")) << "beyond half of it";
    }
  }
  EXPECT_THAT(rig.signals.take(), ElementsAre("hold 1"));
}

// Each of many senders is held in time, but all of them together had more under way than any
// reserve.
TEST(FullOutbox, BlockOfManySendersIsKept) {
  EgressRig rig(small_limits());
  TestConnection connection(rig);
  block(connection);
  for (std::uint32_t sender = 1; sender <= 100; ++sender) {
    for (int i = 0; i < 20; ++i) rig.push(connection.outbox, sized(kKiB), {.src = sender});
  }
  EXPECT_FALSE(rig.tally.any_dropped);
  EXPECT_TRUE(rig.ledger_exact());
}

TEST(FullOutbox, BlockOfASenderThatComesThoughHeldIsDroppedBeyondWhatWasUnderWay) {
  Limits limits = small_limits();
  limits.mailbox_bytes = 512 * kKiB;
  limits.turn_bytes = 64 * kKiB;
  EgressRig rig(limits);
  TestConnection connection(rig);
  block(connection);
  const auto push = [&](std::uint32_t sender) {
    rig.push(connection.outbox, sized(kKiB), {.src = sender});
  };
  for (int i = 0; i < 8 + 16; ++i) push(1);
  EXPECT_THAT(rig.signals.take(), ElementsAre("pause 1")) << "within the reserve";
  for (int i = 0; i < 512 + 64 + 8 * 16; ++i) push(1);
  EXPECT_EQ(rig.signals.take()[0], "hold 1");
  EXPECT_FALSE(rig.tally.any_dropped);
  push(1);
  rig.push_fragment(connection.outbox, 1, 0, 100, "dropped with its rest");
  rig.push_fragment(connection.outbox, 1, 21, 100, "the rest");
  EXPECT_EQ(rig.dropped(DropReason::queue_full), 2u);
  EXPECT_EQ(rig.dropped(DropReason::cut_message), 1u);
  push(2);
  EXPECT_EQ(rig.dropped(DropReason::queue_full), 2u) << "another sender loses nothing by it";
  EXPECT_TRUE(rig.ledger_exact());
}

TEST(FullOutbox, TheRestOfEveryMessageThatFoundNoRoomIsRefused) {
  EgressRig rig(small_limits());
  TestConnection connection(rig);
  block(connection);
  for (int i = 0; i < 16; ++i) rig.push(connection.outbox, sized(kKiB, 'g'), {.flags = kDrop});
  constexpr std::uint32_t kMany = 1'000;
  for (std::uint32_t number = 1; number <= kMany; ++number) {
    rig.push_fragment(connection.outbox, number, 0, 2'000, std::string(1'000, 'a'),
                      {.flags = kDrop});
  }
  EXPECT_EQ(rig.dropped(DropReason::queue_full), kMany);
  for (std::uint32_t number = 1; number <= kMany; ++number) {
    rig.push_fragment(connection.outbox, number, 1'000, 2'000, std::string(1'000, 'a'),
                      {.flags = kDrop, .lane = 2});
  }
  EXPECT_EQ(rig.dropped(DropReason::cut_message), kMany);
  EXPECT_TRUE(rig.ledger_exact());
}

TEST(FullOutbox, AMessageLargerThanItsLaneMayWaitAlone) {
  EgressRig rig(small_limits());
  TestConnection connection(rig);
  block(connection);
  rig.push(connection.outbox, sized(40 * kKiB), {.kind = Kind::group});
  EXPECT_EQ(rig.dropped(DropReason::queue_full), 0u);
  rig.push(connection.outbox, sized(40 * kKiB), {.kind = Kind::group});
  EXPECT_EQ(rig.dropped(DropReason::queue_full), 1u) << "the older one";
  EXPECT_TRUE(rig.ledger_exact());
}

// An outbox may always hold the message that is being written and the newest one.
TEST(FullOutbox, TheNewestOfMessagesLargerThanTheirLaneWaitsBehindTheOneBeingWritten) {
  for (const std::uint8_t flags : {kLatest, std::uint8_t{0}, kDrop}) {
    EgressRig rig(small_limits());
    TestConnection connection(rig);
    constexpr std::uint32_t kPart = 10'000;
    const auto message = [&](std::uint32_t number) {
      for (std::uint32_t offset = 0; offset < 4 * kPart; offset += kPart) {
        rig.push_fragment(connection.outbox, number, offset, 4 * kPart,
                          "key____1" + std::string(kPart - 8, static_cast<char>('0' + number)),
                          {.kind = Kind::group, .flags = flags});
      }
    };
    connection.peer.set_room(proto::kHeaderSize);
    message(1);
    connection.flush();
    connection.peer.set_room(2 * kPart);
    connection.flush();
    message(2);
    message(3);
    connection.peer.set_room(MemoryPeer::kAll);
    connection.flush();
    const auto texts = connection.take();
    ASSERT_THAT(texts, SizeIs(8)) << int{flags};
    EXPECT_EQ(texts[4].substr(0, 2), flags == kDrop ? "2:" : "3:") << int{flags};
    EXPECT_EQ(rig.dropped(DropReason::cut_message) + rig.dropped(DropReason::replaced) +
                  rig.dropped(DropReason::queue_full),
              4u);
    EXPECT_TRUE(rig.ledger_exact());
  }
}

// One pair of nodes could fill the budget of the whole hub with it.
TEST(FullOutbox, ARestWithoutABeginningIsRefused) {
  EgressRig rig(small_limits());
  TestConnection connection(rig);
  rig.push_fragment(connection.outbox, 1, 1'000, 2'000, std::string(500, 'a'), {.flags = kDrop});
  EXPECT_EQ(rig.dropped(DropReason::cut_message), 1u) << "where nothing waits, too";
  block(connection);
  for (std::uint32_t number = 1; number <= 100; ++number) {
    rig.push_fragment(connection.outbox, number, 1'000, 1 << 30, std::string(1'000, 'a'),
                      {.flags = kDrop});
  }
  EXPECT_EQ(rig.dropped(DropReason::cut_message), 101u);
  EXPECT_EQ(connection.outbox.lane(1).bytes(), 0u);
  // Under another sender's number neither.
  rig.push_fragment(connection.outbox, 7, 0, 2'000, std::string(1'000, 'a'), {.src = 2});
  rig.push_fragment(connection.outbox, 7, 1'000, 2'000, std::string(1'000, 'a'), {.src = 3});
  EXPECT_EQ(rig.dropped(DropReason::cut_message), 102u);
  rig.push_fragment(connection.outbox, 7, 1'000, 2'000, std::string(1'000, 'a'), {.src = 2});
  rig.push_fragment(connection.outbox, 7, 1'000, 2'000, std::string(1'000, 'a'), {.src = 2});
  EXPECT_EQ(rig.dropped(DropReason::cut_message), 103u) << "its end came before";
  EXPECT_TRUE(rig.ledger_exact());
}

// The budget bounds everything, also the rest of messages whose beginning was written.
TEST(FullOutbox, TheBudgetBoundsContinuedMessagesToo) {
  Limits limits;
  limits.budget_bytes = 4 << 20;
  EgressRig rig(limits);
  TestConnection connection(rig);
  for (std::uint32_t number = 1; number <= 100; ++number) {
    rig.push_fragment(connection.outbox, number, 0, 1 << 30, "a", {.flags = kDrop, .dst = number});
  }
  block(connection);
  for (std::uint32_t round = 0; round < 10; ++round) {
    for (std::uint32_t number = 1; number <= 100; ++number) {
      rig.push_fragment(connection.outbox, number, 60'000 + round, 1 << 30,
                        std::string(30'000, 'a'), {.flags = kDrop, .dst = number});
      connection.flush();
    }
  }
  EXPECT_EQ(rig.dropped(DropReason::over_budget), 100u)
      << "of each message that goes on what comes then";
  EXPECT_GT(rig.dropped(DropReason::cut_message), 700u) << "and its rest";
  EXPECT_LE(rig.pool.pinned_bytes(), (4u << 20) + 400'000u);
  EXPECT_TRUE(rig.ledger_exact());
}

}  // namespace
}  // namespace gimnet::hub
