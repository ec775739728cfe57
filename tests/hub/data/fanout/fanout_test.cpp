#include "hub/data/fanout/fanout.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/data/support/route_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::DropReason;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using testing::RouteRig;
using ::testing::SizeIs;

constexpr ShardIndex kThere{1};
constexpr std::uint8_t kDrop = 2;

TEST(Fanout, NeighbouringFramesBecomeOneEntry) {
  RouteRig rig;
  rig.fanout.hand_over(kThere, rig.egress.run({"one"}));
  rig.fanout.hand_over(kThere, rig.egress.run({"two", "three"}, {.lane = 2}));
  EXPECT_THAT(rig.take_mail(), IsEmpty()) << "more may come";
  rig.fanout.post_all();
  EXPECT_THAT(rig.take_mail(), ElementsAre(3u));
  rig.fanout.post_all();
  EXPECT_THAT(rig.take_mail(), IsEmpty());
  EXPECT_EQ(rig.fanout.take_posted(), 0b10u);
  EXPECT_EQ(rig.fanout.take_posted(), 0u);
}

TEST(Fanout, AGapBeginsAnotherEntry) {
  RouteRig rig;
  rig.fanout.hand_over(kThere, rig.egress.run({"one"}));
  const hub::Run between = rig.egress.run({"for somebody else"});
  rig.fanout.hand_over(kThere, rig.egress.run({"two"}));
  rig.fanout.post_all();
  EXPECT_THAT(rig.take_mail(), ElementsAre(1u, 1u));
  static_cast<void>(between);
}

TEST(Fanout, AFullMailboxDropsWhatMayBeDropped) {
  Limits limits;
  limits.mailbox_entries = 2;
  RouteRig rig(limits);
  for (int i = 0; i < 3; ++i) {
    rig.fanout.hand_over(kThere, rig.egress.run({"x"}, {.flags = kDrop}));
    rig.fanout.post_all();
  }
  EXPECT_EQ(rig.egress.dropped(DropReason::shard_full), 1u);
  EXPECT_EQ(rig.fanout.crowded(), 0b10u);
  // One stretch: block, drop, drop, block, block.
  rig.fanout.hand_over(kThere, rig.egress.run({"b"}));
  rig.fanout.hand_over(kThere, rig.egress.run({"d", "d"}, {.flags = kDrop}));
  rig.fanout.hand_over(kThere, rig.egress.run({"b", "b"}));
  rig.fanout.post_all();
  EXPECT_EQ(rig.egress.dropped(DropReason::shard_full), 3u);
  EXPECT_THAT(rig.take_mail(), ElementsAre(1u, 1u, 1u, 2u));
  EXPECT_TRUE(rig.ledger_exact());
  rig.fanout.look_for_room();
  EXPECT_EQ(rig.fanout.crowded(), 0u);
}

TEST(Fanout, CutsIdsIntoOneCopyForAll) {
  RouteRig rig;
  proto::FrameHeader header;
  header.kind = proto::Kind::list;
  header.length = 7;
  const hub::Run frame = rig.egress.run({"idididid"
                                         "payload"},
                                        {.kind = proto::Kind::list});
  const hub::Run first = rig.fanout.cut_ids(frame, header, 8);
  EXPECT_EQ(first.size, proto::kHeaderSize + 7);
  EXPECT_EQ(std::memcmp(first.bytes + proto::kHeaderSize, "payload", 7), 0);
  const hub::Run second = rig.fanout.cut_ids(frame, header, 8);
  EXPECT_EQ(second.bytes, first.bytes + first.size) << "behind what is still kept";
}

TEST(Fanout, DropsSinglyWhatIsTooLarge) {
  RouteRig rig;
  Recipient& a = rig.add_here(2);
  a.frame_bytes = 10;
  const hub::Run run = rig.egress.run({std::string(10, 'a'), std::string(11, 'b'), "c"});
  rig.fanout.deliver(a, run, run.header(), {});
  EXPECT_EQ(rig.egress.dropped(DropReason::too_large), 1u);
  EXPECT_EQ(rig.egress.tally.queued, 2);
  EXPECT_TRUE(rig.ledger_exact());
}

TEST(RecipientTable, FindsASessionByItsGenerationOnly) {
  RouteRig rig;
  Recipient& a = rig.add_here(2);
  EXPECT_EQ(rig.recipients.find(ConnectionSlot{2}, 2), &a);
  EXPECT_EQ(rig.recipients.find(ConnectionSlot{2}, 3), nullptr);
  EXPECT_EQ(rig.recipients.find(ConnectionSlot{99}, 2), nullptr);
  rig.recipients.mark_dirty(a);
  rig.recipients.mark_dirty(a);
  EXPECT_THAT(rig.recipients.dirty(), SizeIs(1));
  rig.recipients.remove(a);
  EXPECT_THAT(rig.recipients.dirty(), IsEmpty());
  EXPECT_EQ(rig.recipients.find(ConnectionSlot{2}, 2), nullptr);
}

}  // namespace
}  // namespace gimnet::hub
