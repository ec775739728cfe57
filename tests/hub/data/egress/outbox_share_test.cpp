#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "hub/data/egress/outbox.hpp"
#include "tests/hub/data/support/outbox_share.hpp"

// While memory is scarce each connection has a share of it. The senders of a full lane share that.

namespace gimnet::hub {
namespace {

using proto::DropReason;
using testing::EgressRig;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using testing::kBlock;
using testing::kDrop;
using testing::kKiB;
using testing::kOldest;
using testing::OutboxShare;
using testing::sized;
using ::testing::SizeIs;
using testing::TestConnection;
using Frames = hub::Run;  // Test has a Run() of its own

TEST_F(OutboxShare, DropsTheOldestBeyondTheShare) {
  block(1);
  rig.push(connection.outbox, sized(room(), 'a'), kOldest);
  EXPECT_EQ(rig.dropped(DropReason::over_budget), 0u) << "exactly the share";
  rig.push(connection.outbox, sized(proto::kHeaderSize + 1, 'b'), kOldest);
  EXPECT_EQ(rig.dropped(DropReason::over_budget), 1u);
  EXPECT_THAT(starts(), ElementsAre("a", "b"));
}

TEST_F(OutboxShare, DropsTheOldestForOneByteMore) {
  block(1);
  rig.push(connection.outbox, sized(room() + 1, 'a'), kOldest);
  EXPECT_EQ(rig.dropped(DropReason::over_budget), 1u);
  EXPECT_THAT(starts(), ElementsAre("a"));
}

TEST_F(OutboxShare, IsOnlyAskedWhileMemoryIsScarce) {
  block();
  rig.push(connection.outbox, sized(share + 1, 'a'), kOldest);
  EXPECT_EQ(rig.dropped(DropReason::over_budget), 2u) << "no message may be larger";
  end_scarce();
  for (int i = 0; i < 4; ++i) rig.push(connection.outbox, sized(share), kOldest);
  EXPECT_EQ(rig.dropped(DropReason::over_budget), 2u);
}

TEST_F(OutboxShare, IsOnlyAskedWhereSomethingWaits) {
  make_scarce();
  for (int i = 0; i < 8; ++i) rig.push(connection.outbox, sized(share), kOldest);
  EXPECT_FALSE(rig.tally.any_dropped) << "it may all be written at the end of the turn";
  EXPECT_THAT(starts(), SizeIs(8));
}

TEST_F(OutboxShare, BothReasonsAreTold) {
  block();
  rig.push(connection.outbox, sized(room(), 'a'), kOldest);
  rig.push(connection.outbox, sized(proto::kHeaderSize), kOldest);
  end_scarce();
  for (int i = 0; i < 60; ++i) rig.push(connection.outbox, sized(share), kOldest);
  const std::uint64_t full = rig.dropped(DropReason::queue_full);
  EXPECT_GT(full, 0u);
  std::vector<proto::flow::Dropped> told;
  const auto tell = [&](const proto::flow::Dropped& losses) {
    told.push_back(losses);
    return losses.reason == DropReason::queue_full;
  };
  connection.outbox.tell_losses(tell);
  ASSERT_THAT(told, SizeIs(2));
  EXPECT_EQ(told[0].count, full);
  EXPECT_EQ(told[1].reason, DropReason::over_budget);
  EXPECT_EQ(told[1].count, rig.dropped(DropReason::over_budget));
  EXPECT_TRUE(connection.outbox.has_untold_losses()) << "what could not be said waits";
  connection.outbox.tell_losses([&](const proto::flow::Dropped& losses) {
    told.push_back(losses);
    return true;
  });
  EXPECT_THAT(told, SizeIs(3));
  EXPECT_FALSE(connection.outbox.has_untold_losses());
}

TEST_F(OutboxShare, TakesFromTheLeastUrgentLaneFirst) {
  block();
  const std::uint64_t third = room() / 3;
  for (const std::uint8_t lane : {std::uint8_t{2}, std::uint8_t{0}}) {
    rig.push(connection.outbox, sized(third - 100, static_cast<char>('0' + lane)),
             {.kind = proto::Kind::group, .lane = lane});
  }
  rig.push(connection.outbox, sized(third + 1'000, '1'), kOldest);
  EXPECT_EQ(rig.dropped(DropReason::over_budget), 2u) << "lanes 3 and 2";
  rig.push(connection.outbox, sized(third + 1'000, '2'), {.kind = proto::Kind::group, .lane = 2});
  EXPECT_EQ(rig.dropped(DropReason::over_budget), 3u) << "not those that are more urgent";
  EXPECT_THAT(starts(), ElementsAre("0", "1"));
}

TEST_F(OutboxShare, ThePolicyDropRefusesTheNewMessage) {
  block();
  rig.push(connection.outbox, sized(room(), 'a'), {.flags = kDrop});
  EXPECT_EQ(rig.dropped(DropReason::over_budget), 0u);
  rig.push(connection.outbox, sized(16, 'b'), {.flags = kDrop});
  EXPECT_EQ(rig.dropped(DropReason::over_budget), 1u);
  EXPECT_THAT(starts(), ElementsAre("a", "f"));
}

TEST_F(OutboxShare, PausesAndHoldsTheSendersOfBlock) {
  block();
  rig.push(connection.outbox, sized(room()), {.flags = kBlock});
  EXPECT_THAT(rig.signals.take(), IsEmpty()) << "exactly the share";
  rig.push(connection.outbox, sized(16), {.flags = kBlock});
  EXPECT_THAT(rig.signals.take(), ElementsAre("pause 1"));
  rig.push(connection.outbox, sized(share + room() - 16), {.flags = kBlock});
  EXPECT_THAT(rig.signals.take(), IsEmpty()) << "as much again";
  rig.push(connection.outbox, sized(17), {.flags = kBlock});
  EXPECT_THAT(rig.signals.take(), ElementsAre("hold 1"));
  EXPECT_FALSE(rig.tally.any_dropped);
  connection.outbox.signal_room(rig.context);
  EXPECT_THAT(rig.signals.take(), IsEmpty()) << "more than half of the share waits";
  EXPECT_THAT(starts(), SizeIs(5));
  EXPECT_THAT(rig.signals.take(), ElementsAre("resume 1", "release 1"));
}

TEST_F(OutboxShare, TheSendersOfBlockGoOnOnceMemoryIsNotScarce) {
  block();
  for (int i = 0; i < 3; ++i) rig.push(connection.outbox, sized(share / 2), {.flags = kBlock});
  EXPECT_THAT(rig.signals.take(), ElementsAre("pause 1"));
  connection.outbox.signal_room(rig.context);
  EXPECT_THAT(rig.signals.take(), IsEmpty());
  end_scarce();
  connection.outbox.signal_room(rig.context);
  EXPECT_THAT(rig.signals.take(), ElementsAre("resume 1")) << "the lane has room";
}

TEST_F(OutboxShare, OfAMessageInFragmentsWhatIsBeyondTheShareIsCut) {
  block();
  constexpr std::uint32_t kPart = 8 * kKiB;
  for (std::uint32_t part = 0; part < 8; ++part) {
    rig.push_fragment(connection.outbox, 1, part * kPart, 8 * kPart, std::string(kPart, 'x'),
                      kOldest);
  }
  EXPECT_LE(connection.outbox.held_bytes(), share + kPart);
  EXPECT_GT(rig.dropped(DropReason::over_budget), 0u);
  EXPECT_GT(rig.dropped(DropReason::cut_message), 0u);
}

TEST_F(OutboxShare, WhatIsWrittenAndNotConfirmedGoesFirst) {
  ResumeBuffer resume{1 << 20};
  connection.outbox.set_resume(&resume);
  for (int i = 0; i < 4; ++i) rig.push(connection.outbox, sized(5'000), kOldest);
  EXPECT_EQ(connection.flush(&resume), Flush::emptied);
  EXPECT_EQ(resume.bytes(), 20'000u);
  block(1);
  rig.push(connection.outbox, sized(room(), 'a'), kOldest);
  EXPECT_EQ(resume.bytes(), 20'000u) << "exactly the share";
  rig.push(connection.outbox, sized(room() + 5'001, 'b'), kOldest);
  EXPECT_EQ(resume.bytes(), 10'000u) << "as many as it takes";
  EXPECT_FALSE(rig.tally.any_dropped);
  connection.outbox.set_resume(nullptr);
  rig.tally.delivered += resume.confirm(4);
  rig.tally.queued -= 4;
}

TEST_F(OutboxShare, KeepsNoMoreThanHalfOfItForConfirmation) {
  ResumeBuffer resume{1 << 20};
  connection.outbox.set_resume(&resume);
  make_scarce();
  for (const std::uint8_t flags : {kDrop, kBlock}) {
    for (int i = 0; i < 3; ++i) rig.push(connection.outbox, sized(share / 4), {.flags = flags});
    const bool waits = flags == kBlock;
    EXPECT_EQ(connection.flush(&resume), waits ? Flush::waits : Flush::emptied);
    EXPECT_EQ(resume.bytes(), share / 4 * 2) << int{flags};
    rig.tally.queued -= 3;
    rig.tally.delivered += 3;
    static_cast<void>(resume.confirm(resume.written()));
  }
  connection.outbox.set_resume(nullptr);
  rig.tally.queued += 1;
  rig.tally.delivered -= 1;  // the last one was not written
}

TEST_F(OutboxShare, AFrameLargerThanThatIsKeptAlone) {
  ResumeBuffer resume{1 << 20};
  connection.outbox.set_resume(&resume);
  make_scarce();
  for (int i = 0; i < 3; ++i) rig.push(connection.outbox, sized(share), kOldest);
  EXPECT_EQ(connection.flush(&resume), Flush::emptied);
  EXPECT_EQ(resume.bytes(), share);
  connection.outbox.set_resume(nullptr);
  rig.tally.queued -= 3;
  rig.tally.delivered += 3;
}

// A waiting frame of 64 KiB would keep a read buffer of 320 KiB, and so would one of 100 bytes that
// goes to many.
TEST_F(OutboxShare, WhatHasToWaitIsCopied) {
  for (const bool fan_out : {false, true}) {
    for (const std::uint32_t size : {100u, 20'000u}) {
      TestConnection slow(rig);
      slow.peer.set_room(0);
      rig.push(slow.outbox, sized(size), kOldest, fan_out);
      EXPECT_EQ(slow.flush(), Flush::blocked);
      const bool refers = slow.outbox.lane(1).front().run.buffer->kind == BufferKind::slab;
      EXPECT_EQ(refers, fan_out || size > kSharedChunkBytes) << size;
    }
  }
  block();
  for (const bool fan_out : {false, true}) {
    for (const std::uint32_t size : {100u, 20'000u}) {
      const std::uint64_t pinned = rig.pool.pinned_bytes();
      TestConnection slow(rig);
      slow.peer.set_room(0);
      rig.push(slow.outbox, sized(size), kOldest, fan_out);
      EXPECT_EQ(slow.flush(), Flush::blocked);
      EXPECT_EQ(slow.outbox.lane(1).front().run.buffer->kind, BufferKind::chunk) << size;
      rig.push(slow.outbox, sized(size / 2), kOldest, fan_out);
      EXPECT_EQ(slow.outbox.lane(1).entries().back().run.buffer->kind, BufferKind::chunk) << size;
      EXPECT_LE(rig.pool.pinned_bytes() - pinned, 2 * size + 4'096) << size;
    }
  }
}

// A run is one piece of memory as long as one frame of it waits.
TEST_F(OutboxShare, ALongRunIsTakenInPieces) {
  block();
  const Frames run = rig.run(std::vector<std::string>(100, sized(kKiB)), kOldest);
  connection.outbox.push(run, run.header(), Handover{}, rig.context);
  EXPECT_LE(connection.outbox.held_bytes(), share + sizeof(Entry));
  EXPECT_GT(connection.outbox.held_bytes(), share - kSharedChunkBytes) << "the newest";
  EXPECT_LE(rig.pool.pinned_bytes(), share + 2 * kSharedChunkBytes);
  RingQueue<Entry>& entries = connection.outbox.lane(1).entries();
  EXPECT_GT(entries.size(), 1u);
}

TEST_F(OutboxShare, WaitingConnectionsAreCounted) {
  const auto waiting = [&] {
    rig.lease.begin_turn(1'000'000 + ++looks_ * 10);
    return rig.budget.waiting() - kOthers;
  };
  EXPECT_EQ(waiting(), 0);
  connection.peer.set_room(0);
  rig.push(connection.outbox, "waits");
  EXPECT_EQ(waiting(), 0) << "before its turn ends nobody knows";
  EXPECT_EQ(connection.flush(), Flush::blocked);
  EXPECT_EQ(waiting(), 1);
  rig.push(connection.outbox, "too");
  EXPECT_EQ(connection.flush(), Flush::blocked);
  EXPECT_EQ(waiting(), 1);
  ResumeBuffer resume{1'000};
  connection.outbox.set_resume(&resume);
  connection.peer.set_room(MemoryPeer::kAll);
  EXPECT_EQ(connection.flush(&resume), Flush::emptied);
  EXPECT_EQ(waiting(), 1) << "until it is confirmed";
  rig.tally.delivered += resume.confirm(2);
  rig.tally.queued -= 2;
  EXPECT_EQ(connection.flush(&resume), Flush::emptied);
  EXPECT_EQ(waiting(), 0);
  connection.outbox.set_resume(nullptr);
  connection.outbox.add_paced(10, rig.context);
  EXPECT_EQ(waiting(), 1) << "what the pacer holds";
  EXPECT_EQ(connection.outbox.held_bytes(), 10u);
  connection.outbox.remove_paced(10, rig.context);
  EXPECT_EQ(waiting(), 0);
}

TEST_F(OutboxShare, WhatIsToBeWrittenAgainCounts) {
  RunQueue again;
  again.push(rig.run({sized(100), sized(100)}));
  rig.tally.queued += 2;
  connection.outbox.replay() = std::move(again);
  EXPECT_EQ(connection.outbox.held_bytes(), 200u);
  connection.peer.set_room(150);
  EXPECT_EQ(connection.flush(), Flush::blocked);
  EXPECT_EQ(connection.outbox.held_bytes(), 0u) << "one is written, one is begun";
  connection.peer.set_room(MemoryPeer::kAll);
  EXPECT_EQ(connection.flush(), Flush::emptied);
}

// Two senders share the half of the lane, 8 KiB: the second one has 4 of it, though the first was
// there before.
TEST(BlockShare, TheSecondSenderIsLetIntoAFullLane) {
  Limits limits;
  limits.lane1_bytes = limits.reserve_bytes = 16 * kKiB;
  EgressRig rig(limits);
  TestConnection connection(rig);
  connection.peer.set_room(0);
  rig.push(connection.outbox, "first", {.lane = 3});
  EXPECT_EQ(connection.flush(), Flush::blocked);
  const auto push = [&](std::uint32_t sender) {
    rig.push(connection.outbox, sized(kKiB), {.src = sender});
  };
  for (int i = 0; i < 9; ++i) push(1);
  EXPECT_THAT(rig.signals.take(), ElementsAre("pause 1"));
  for (int i = 0; i < 4; ++i) push(2);
  EXPECT_THAT(rig.signals.take(), IsEmpty());
  push(2);
  EXPECT_THAT(rig.signals.take(), ElementsAre("pause 2"));
  // The first one may go on when it is down to half of its share, 2 KiB.
  connection.peer.set_room(5 * kKiB);
  connection.flush();
  EXPECT_THAT(rig.signals.take(), IsEmpty());
  connection.peer.set_room(9 * kKiB);
  connection.flush();
  EXPECT_THAT(rig.signals.take(), ElementsAre("resume 1"));
  EXPECT_TRUE(rig.ledger_exact());
}

}  // namespace
}  // namespace gimnet::hub
