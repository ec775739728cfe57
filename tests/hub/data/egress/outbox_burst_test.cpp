#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "hub/data/egress/outbox.hpp"
#include "tests/hub/data/support/outbox_share.hpp"

// A connection that keeps up may have a burst while memory is scarce: it has no share for a second.

namespace gimnet::hub {
namespace {

using proto::DropReason;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using testing::kBlock;
using testing::kKiB;
using testing::kOldest;
using testing::sized;
using ::testing::SizeIs;

class OutboxBurst : public testing::OutboxShare {};

TEST_F(OutboxBurst, HasNoShareForASecond) {
  connection.peer.set_room(0);
  rig.push(connection.outbox, "first", kOldest);
  EXPECT_EQ(connection.flush(), Flush::blocked);
  make_scarce(kWithSpare);
  for (int i = 0; i < 4; ++i) rig.push(connection.outbox, sized(share), kOldest);
  rig.context.now_ms += Outbox::kBurstMs - 1;
  for (int i = 0; i < 4; ++i) rig.push(connection.outbox, sized(share), kOldest);
  EXPECT_FALSE(rig.tally.any_dropped) << "the lane has room for more";
  rig.context.now_ms += 1;
  rig.push(connection.outbox, sized(kKiB, 'n'), kOldest);
  EXPECT_EQ(rig.dropped(DropReason::over_budget), 9u) << "it does not keep up";
  EXPECT_LE(connection.outbox.held_bytes(), share);
  EXPECT_THAT(starts(), ElementsAre("n"));
  // It has caught up.
  connection.peer.set_room(0);
  for (int i = 0; i < 2; ++i) {
    for (int k = 0; k < 4; ++k) rig.push(connection.outbox, sized(share), kOldest);
    EXPECT_EQ(connection.flush(), Flush::blocked);
  }
  EXPECT_EQ(rig.dropped(DropReason::over_budget), 9u);
  EXPECT_THAT(starts(), SizeIs(8));
}

TEST_F(OutboxBurst, HasAShareOnceLessThanASixthIsFree) {
  connection.peer.set_room(0);
  rig.push(connection.outbox, "first", kOldest);
  EXPECT_EQ(connection.flush(), Flush::blocked);
  make_scarce(kWithSpare);
  std::uint64_t pushed = 0;
  for (; !rig.tally.any_dropped && pushed < 100; ++pushed)
    rig.push(connection.outbox, sized(share), kOldest);
  EXPECT_GT(pushed, 28u) << "1 MiB of 12, less what it takes to keep them in order";
  EXPECT_LE(pushed, 33u) << "found out within the turn";
  EXPECT_LE(connection.outbox.held_bytes(), share + sizeof(Entry));
}

TEST_F(OutboxBurst, PausesNoSenderForASecond) {
  connection.peer.set_room(0);
  rig.push(connection.outbox, "first", kOldest);
  EXPECT_EQ(connection.flush(), Flush::blocked);
  make_scarce(kWithSpare);
  for (int i = 0; i < 8; ++i) rig.push(connection.outbox, sized(share), {.flags = kBlock});
  EXPECT_THAT(rig.signals.take(), IsEmpty());
  rig.context.now_ms += Outbox::kBurstMs;
  rig.push(connection.outbox, sized(share), {.flags = kBlock});
  EXPECT_THAT(rig.signals.take(), ElementsAre("pause 1", "hold 1")) << "several shares wait";
  EXPECT_THAT(starts(), SizeIs(10));
  EXPECT_THAT(rig.signals.take(), ElementsAre("resume 1", "release 1"));
}

TEST_F(OutboxBurst, OfWhatThePacerHoldsHasAShareAfterASecond) {
  make_scarce(kWithSpare);
  connection.outbox.add_paced(share, rig.context);
  EXPECT_FALSE(connection.outbox.over_share(1, rig.context)) << "it has just begun";
  rig.context.now_ms += Outbox::kBurstMs;
  EXPECT_TRUE(connection.outbox.over_share(1, rig.context));
  connection.outbox.remove_paced(share, rig.context);
  connection.outbox.add_paced(share, rig.context);
  EXPECT_FALSE(connection.outbox.over_share(1, rig.context)) << "nothing was held for a moment";
  connection.outbox.remove_paced(share, rig.context);
}

TEST_F(OutboxBurst, KeepsAllForConfirmationWhileItKeepsUp) {
  ResumeBuffer resume{1 << 20};
  connection.outbox.set_resume(&resume);
  make_scarce(kWithSpare);
  for (int i = 0; i < 3; ++i) rig.push(connection.outbox, sized(share), {.flags = kBlock});
  EXPECT_EQ(connection.flush(&resume), Flush::emptied);
  EXPECT_EQ(resume.bytes(), share * 3);
  rig.tally.queued -= 3;
  rig.tally.delivered += 3;
  static_cast<void>(resume.confirm(resume.written()));
  connection.outbox.set_resume(nullptr);
}

}  // namespace
}  // namespace gimnet::hub
