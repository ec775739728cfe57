#include "hub/data/route/router.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/data/support/route_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::DropReason;
using proto::Kind;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using testing::RouteRig;

constexpr std::uint32_t kHub = 7u << 20;
constexpr std::uint64_t kNoEnd = ~std::uint64_t{0};

class RouterTest : public ::testing::Test {
 protected:
  void TearDown() override { EXPECT_TRUE(rig.ledger_exact()); }
  std::uint64_t dropped(DropReason reason) { return rig.egress.dropped(reason); }
  RouteRig rig;
};

TEST_F(RouterTest, UnicastHere) {
  Recipient& a = rig.add_here(2);
  rig.route(kHub | 2, {"one", "two"});
  EXPECT_EQ(a.outbox.lane(1).front().frames, 2u);
  EXPECT_TRUE(a.dirty);
  EXPECT_EQ(rig.egress.tally.queued, 2);
  EXPECT_EQ(rig.egress.tally.copies, 0u);
}

TEST_F(RouterTest, UnicastThere) {
  rig.add_there(3);
  rig.route(kHub | 3, {"one", "two", "three"});
  EXPECT_THAT(rig.take_mail(), ElementsAre(3u));
  EXPECT_EQ(rig.egress.tally.queued, 3) << "a mailbox is a queue";
}

TEST_F(RouterTest, SmallFramesLikeTheLastOnesAreAppended) {
  Recipient& a = rig.add_here(2);
  rig.add_there(3);
  rig.route(kHub | 2, {"the first"});
  rig.route(kHub | 2, {"more"});
  rig.route(kHub | 3, {"for another shard"});
  rig.route(kHub | 4, {"for nobody"});
  rig.route(8u << 20 | 2, {"for another hub's node"});
  rig.route(kHub | 2, {"more"});
  a.frame_bytes = 3;
  rig.route(kHub | 2, {"more than it takes"});
  EXPECT_EQ(dropped(DropReason::too_large), 1u);
  rig.route(kHub | 2, {"few"});
  EXPECT_EQ(a.outbox.lane(1).front().frames, 4u);
  EXPECT_THAT(rig.take_mail(), ElementsAre(1u));
}

TEST_F(RouterTest, AGroupOfTheSameNumberIsNoNode) {
  Recipient& a = rig.add_here(2);
  Recipient& b = rig.add_here(3);
  rig.publish_group(2, 1, {2, 3}, {});
  rig.route(kHub | 2, {"to one"});
  for (int i = 0; i < 2; ++i) rig.route(kHub | 2, {"to both"}, {.kind = Kind::group});
  EXPECT_EQ(a.outbox.lane(1).entries().size(), 2u);
  EXPECT_EQ(b.outbox.lane(1).front().frames, 2u);
}

TEST_F(RouterTest, AskedAgainAfterTheTablesChanged) {
  rig.add_here(2);
  Recipient& b = rig.add_here(3);
  rig.router.begin_bytes(NodeId{kHub | 1});
  rig.route(kHub | 2, {"to the first"});
  rig.nodes.publish(2, {ShardIndex{0}, b.slot, b.generation});
  rig.router.begin_bytes(NodeId{kHub | 1});
  rig.route(kHub | 2, {"to its successor"});
  EXPECT_EQ(b.outbox.lane(1).front().frames, 1u);
}

TEST_F(RouterTest, UnicastToNobody) {
  rig.route(kHub | 9, {"x"});
  rig.route(kHub, {"the hub itself"});
  rig.route(8u << 20 | 1, {"another hub"});
  EXPECT_EQ(dropped(DropReason::no_such_node), 2u);
  EXPECT_EQ(dropped(DropReason::no_route), 1u);
}

TEST_F(RouterTest, WhoIsNotBackYetAfterARestartIsAway) {
  for (const std::uint32_t index : {7u, 8u}) rig.nodes.expect(index);
  rig.route(kHub | 8, {"x"});
  rig.route(kHub | 9, {"x"});
  std::string ids(8, '\0');
  const std::uint32_t all[] = {kHub | 7, 8u << 20 | 1};
  std::memcpy(ids.data(), all, sizeof all);
  rig.route(2, {ids + "payload"}, {.kind = Kind::list});
  EXPECT_EQ(dropped(DropReason::away), 2u);
  EXPECT_EQ(dropped(DropReason::no_such_node), 1u);
  EXPECT_EQ(dropped(DropReason::no_route), 1u);
}

TEST_F(RouterTest, UnicastToASlotThatIsSomebodyElses) {
  rig.add_here(2);
  rig.nodes.publish(2, {ShardIndex{0}, ConnectionSlot{2}, 99});
  rig.route(kHub | 2, {"x"});
  EXPECT_EQ(dropped(DropReason::no_such_node), 1u);
}

TEST_F(RouterTest, UnicastToSomebodyAway) {
  Recipient& a = rig.add_here(2);
  a.connected = false;
  rig.route(kHub | 2, {"x"});
  EXPECT_EQ(dropped(DropReason::away), 1u);
  a.waits_when_away = true;
  rig.route(kHub | 2, {"x"});
  EXPECT_EQ(dropped(DropReason::away), 1u);
  EXPECT_FALSE(a.outbox.empty());
}

TEST_F(RouterTest, GroupHereAndThere) {
  Recipient& a = rig.add_here(2);
  Recipient& b = rig.add_here(3);
  rig.publish_group(5, 1, {2, 3, 77}, {4, 5});
  rig.route(kHub | 5, {"x", "y"}, {.kind = Kind::group});
  EXPECT_FALSE(a.outbox.empty());
  EXPECT_FALSE(b.outbox.empty());
  EXPECT_THAT(rig.take_mail(), ElementsAre(2u)) << "one entry, however many subscribers are there";
  EXPECT_EQ(rig.egress.tally.copies, 4u) << "3 recipients: 2 here, and the other shard";
}

TEST_F(RouterTest, GroupDrops) {
  rig.publish_group(5, 1, {}, {});
  rig.route(kHub | 5, {"x"}, {.kind = Kind::group});
  EXPECT_EQ(dropped(DropReason::no_subscriber), 1u);
  rig.route(kHub | 5, {"x"}, {.kind = Kind::group, .src = 2});
  EXPECT_EQ(dropped(DropReason::not_allowed), 1u);
  rig.route(kHub | 6, {"x"}, {.kind = Kind::group});
  EXPECT_EQ(dropped(DropReason::no_such_group), 1u);
  rig.route(8u << 20 | 5, {"x"}, {.kind = Kind::group});
  EXPECT_EQ(dropped(DropReason::no_route), 1u);
}

TEST_F(RouterTest, FewSubscribersGetCopiesAndManyReferences) {
  for (std::uint32_t count : {3u, 4u}) {
    RouteRig fresh;
    std::vector<std::uint32_t> members;
    for (std::uint32_t i = 0; i < count; ++i) {
      fresh.add_here(2 + i);
      members.push_back(2 + i);
    }
    fresh.publish_group(5, 1, members, {});
    fresh.route(kHub | 5, {"x"}, {.kind = Kind::group});
    EXPECT_EQ(fresh.egress.tally.copied_bytes == 0, count >= 4);
    EXPECT_TRUE(fresh.ledger_exact());
  }
}

TEST_F(RouterTest, LargeFramesAreNeverCopied) {
  std::vector<std::uint32_t> members;
  for (std::uint32_t i = 0; i < 100; ++i) {
    rig.add_here(2 + i);
    members.push_back(2 + i);
  }
  rig.publish_group(5, 1, members, {});
  rig.route(kHub | 5, {std::string(65'536, 'x')}, {.kind = Kind::group});
  EXPECT_EQ(rig.egress.tally.copied_bytes, 0u);
  EXPECT_EQ(rig.egress.tally.queued, 100);
}

TEST_F(RouterTest, ServiceGoesToTheProvider) {
  Recipient& provider = rig.add_here(2);
  rig.publish_group(5, 2, {}, {}, true);
  rig.route(kHub | 5, {"request"}, {.kind = Kind::service});
  EXPECT_FALSE(provider.outbox.empty());
  rig.route(kHub | 6, {"request"}, {.kind = Kind::service});
  EXPECT_EQ(dropped(DropReason::no_such_group), 1u);
}

// Whatever a turn sees first of REASSIGN: the group of before it, the node table of after it.
TEST_F(RouterTest, ServiceGoesToAProviderThatIsRenumberedJustNow) {
  const Recipient& here = rig.add_here(2);
  rig.publish_group(5, 2, {}, {}, true);
  rig.nodes.publish(2, NodePlace::renumbered());
  rig.route(kHub | 5, {"request"}, {.kind = Kind::service});
  EXPECT_FALSE(here.outbox.empty());
  rig.add_there(3);
  rig.publish_group(5, 3, {}, {}, true);
  rig.nodes.publish(3, NodePlace::renumbered());
  rig.route(kHub | 5, {"one", "two"}, {.kind = Kind::service});
  EXPECT_THAT(rig.take_mail(), ElementsAre(2u));
  EXPECT_EQ(dropped(DropReason::renumbered), 0u);
}

TEST_F(RouterTest, ServiceIsRefusedWhereTheServiceOnlyProvides) {
  const Recipient& provider = rig.add_here(2);
  rig.add_there(3);
  rig.publish_group(5, 2, {}, {});
  rig.route(kHub | 5, {"one", "two"}, {.kind = Kind::service});
  EXPECT_TRUE(provider.outbox.empty());
  rig.publish_group(5, 3, {}, {});
  rig.route(kHub | 5, {"to another shard"}, {.kind = Kind::service});
  EXPECT_THAT(rig.take_mail(), IsEmpty());
  EXPECT_EQ(dropped(DropReason::not_allowed), 3u);
}

TEST_F(RouterTest, ListHereThereAndNowhere) {
  Recipient& a = rig.add_here(2);
  rig.add_there(3);
  std::string ids(16, '\0');
  const std::uint32_t all[] = {kHub | 2, kHub | 3, kHub | 9, 8u << 20 | 1};
  std::memcpy(ids.data(), all, sizeof all);
  rig.route(4, {ids + "payload"}, {.kind = Kind::list});
  EXPECT_EQ(a.outbox.lane(1).front().run.header().length, 7u);
  EXPECT_EQ(a.outbox.lane(1).front().run.header().dst, 0u);
  EXPECT_THAT(rig.take_mail(), ElementsAre(1u));
  EXPECT_EQ(dropped(DropReason::no_such_node), 1u);
  EXPECT_EQ(dropped(DropReason::no_route), 1u);
  EXPECT_EQ(rig.egress.tally.copies, 3u);
}

TEST_F(RouterTest, BroadcastToAllButTheSender) {
  Recipient& sender = rig.add_here(1);
  Recipient& a = rig.add_here(2);
  rig.route(kHub | kEveryIndex, {"x"}, {.kind = Kind::broadcast});
  EXPECT_TRUE(sender.outbox.empty());
  EXPECT_FALSE(a.outbox.empty());
  EXPECT_THAT(rig.take_mail(), IsEmpty()) << "nobody lives there";
  rig.add_there(3);
  rig.route(0xFFFFFFFF, {"x"}, {.kind = Kind::broadcast});
  EXPECT_THAT(rig.take_mail(), ElementsAre(1u));
  rig.route(kHub | 5, {"x"}, {.kind = Kind::broadcast});
  EXPECT_EQ(dropped(DropReason::no_such_node), 1u);
  rig.route(8u << 20 | kEveryIndex, {"x"}, {.kind = Kind::broadcast});
  EXPECT_EQ(dropped(DropReason::no_route), 1u);
}

TEST_F(RouterTest, BroadcastToThoseThatAreLeft) {
  Recipient& first = rig.add_here(2);
  const std::array left{&rig.add_here(900), &rig.add_here(3), &rig.add_here(40)};
  Recipient& last = rig.add_here(5);
  rig.recipients.remove(last);
  rig.recipients.remove(first);
  rig.route(kHub | kEveryIndex, {"x"}, {.kind = Kind::broadcast});
  for (Recipient* const recipient : left) EXPECT_EQ(recipient->outbox.lane(1).entries().size(), 1u);
  EXPECT_TRUE(first.outbox.empty());
  EXPECT_TRUE(last.outbox.empty());
  EXPECT_EQ(rig.router.deliveries(), 3u) << "free slots cost nothing";
}

TEST_F(RouterTest, WhatWasHandedOverStaysHere) {
  Recipient& a = rig.add_here(2);
  rig.add_there(3);
  // As it comes out of a mailbox: mixed frames, already counted by the sending shard.
  hub::Run frames = rig.make_run(kHub | 2, {"one", "two"});
  const hub::Run gone = rig.make_run(kHub | 3, {"left meanwhile"});
  ASSERT_TRUE(frames.extend(gone));
  rig.egress.tally.queued += 3;
  EXPECT_EQ(rig.router.route_handed_over(frames, 65'536, kNoEnd).frames, 0u);
  EXPECT_EQ(a.outbox.lane(1).front().frames, 2u);
  EXPECT_EQ(dropped(DropReason::no_such_node), 1u);
  EXPECT_THAT(rig.take_mail(), IsEmpty()) << "nothing is handed on";
}

TEST_F(RouterTest, CountsTheRecipientsOfFramesToMany) {
  for (std::uint32_t index = 2; index <= 4; ++index) rig.add_here(index);
  rig.add_there(10);
  rig.route(kHub | 2, {"one", "two"});
  EXPECT_EQ(rig.router.deliveries(), 0u) << "frames to one are bounded by what is read";
  rig.publish_group(5, 1, {2, 3, 4}, {10, 11});
  rig.route(kHub | 5, {"one", "two"}, {.kind = Kind::group});
  EXPECT_EQ(rig.router.deliveries(), 5u) << "a run is one frame";
  EXPECT_THAT(rig.take_mail(), ElementsAre(2u));
}

TEST_F(RouterTest, LeavesWhatWasHandedOverBeyondItsEnd) {
  Recipient& a = rig.add_here(2);
  rig.add_here(3);
  rig.publish_group(5, 1, {2, 3}, {});
  hub::Run frames = rig.make_run(kHub | 5, {"one"}, {.kind = Kind::group});
  for (const auto lane : {std::uint8_t{2}, std::uint8_t{1}, std::uint8_t{2}}) {
    ASSERT_TRUE(frames.extend(
        rig.make_run(kHub | 5, {"more", "and more"}, {.kind = Kind::group, .lane = lane})));
  }
  rig.egress.tally.queued += 7;
  const hub::Run rest = rig.router.route_handed_over(frames, 65'536, rig.router.deliveries() + 3);
  EXPECT_EQ(rest.frames, 4u) << "the run that passes the end is handed on whole";
  EXPECT_EQ(a.outbox.lane(1).front().frames, 1u);
  EXPECT_EQ(a.outbox.lane(2).front().frames, 2u);
  EXPECT_EQ(rig.router.route_handed_over(rest, 65'536, kNoEnd).frames, 0u);
  EXPECT_EQ(rig.egress.tally.queued, 14);
}

std::string with_ids(const std::vector<std::uint32_t>& ids, const std::string& payload) {
  std::string all(4 * ids.size(), '\0');
  std::memcpy(all.data(), ids.data(), all.size());
  return all + payload;
}

/// This shard takes the mail for the other one, as if it were that.
std::uint64_t take_back_mail(RouteRig& rig) {
  std::uint64_t frames = 0;
  rig.mailbox_there.drain(
      1'000, [] {},
      [&](const Mail& mail) {
        const hub::Run run{rig.egress.pool.adopt(mail.lent), mail.bytes, mail.size, mail.frames};
        frames += mail.frames;
        EXPECT_EQ(rig.router.route_handed_over(run, 65'536, kNoEnd).frames, 0u);
      });
  return frames;
}

TEST_F(RouterTest, OfAListEachShardCountsItsIds) {
  Recipient& a = rig.add_here(2);
  Recipient& b = rig.add_here(4);
  rig.add_there(2);
  rig.add_there(3);
  rig.route(3, {with_ids({kHub | 2, kHub | 3, kHub | 4}, "payload")}, {.kind = Kind::list});
  EXPECT_EQ(b.outbox.lane(1).front().run.header().length, 7u);
  EXPECT_EQ(rig.egress.tally.copies, 1u) << "two for another shard are one there";
  // Until it looks one of them has left.
  rig.nodes.publish(2, {ShardIndex{0}, a.slot, a.generation});
  rig.nodes.publish(3, {});
  EXPECT_EQ(take_back_mail(rig), 1u);
  EXPECT_EQ(a.outbox.lane(1).front().run.header().dst, 0u);
  EXPECT_EQ(a.outbox.lane(1).front().run.size, proto::kHeaderSize + 7u);
  EXPECT_EQ(b.outbox.lane(1).front().frames, 1u) << "once";
  EXPECT_EQ(dropped(DropReason::no_such_node), 1u);
  EXPECT_EQ(rig.egress.tally.copies, 2u);
  EXPECT_TRUE(rig.ledger_exact());
  // The next one has none of these ids.
  rig.add_there(5);
  rig.route(1, {with_ids({kHub | 5}, "next")}, {.kind = Kind::list});
  rig.nodes.publish(5, {});
  EXPECT_EQ(take_back_mail(rig), 1u);
  EXPECT_EQ(dropped(DropReason::no_such_node), 2u);
  EXPECT_EQ(a.outbox.lane(1).front().frames, 1u);
}

TEST_F(RouterTest, AListOfTheLargestFrameIsHandedOver) {
  const auto length = static_cast<std::uint32_t>(rig.egress.limits.frame_bytes);
  Recipient& a = rig.add_here(2);
  rig.add_there(2);
  rig.route(1, {with_ids({kHub | 2}, std::string(length - 4, 'x'))}, {.kind = Kind::list});
  rig.nodes.publish(2, {ShardIndex{0}, a.slot, a.generation});
  rig.mailbox_there.drain(
      1'000, [] {},
      [&](const Mail& mail) {
        const hub::Run run{rig.egress.pool.adopt(mail.lent), mail.bytes, mail.size, mail.frames};
        EXPECT_EQ(rig.router.route_handed_over(run, length, kNoEnd).frames, 0u);
      });
  EXPECT_EQ(a.outbox.lane(1).front().run.header().length, length - 4);
}

TEST_F(RouterTest, ReportsAListWithoutItsIds) {
  rig.add_there(3);
  rig.route(4, {with_ids({6u << 20 | 2, kHub | 2, kHub | 3, kHub | 4}, "payload")},
            {.kind = Kind::list, .flags = proto::kFlagReport});
  rig.nodes.publish(3, {});
  EXPECT_EQ(take_back_mail(rig), 1u);
  std::uint32_t lost = 0;
  rig.egress.drops.flush(1'000, [&](NodeId sender, std::span<const std::byte> payload) {
    const auto report = proto::decode_report(payload);
    EXPECT_TRUE(report);
    if (!report) return false;
    lost += report->count;
    EXPECT_EQ(sender, NodeId{kHub | 1});
    EXPECT_EQ(report->header.dst, 0u);
    EXPECT_EQ(report->header.length, 7u);
    EXPECT_EQ(std::memcmp(report->following.data(), "payload", 7), 0);
    return true;
  });
  EXPECT_EQ(lost, 4u);
  EXPECT_EQ(dropped(DropReason::no_route), 1u);
  EXPECT_EQ(dropped(DropReason::no_such_node), 3u);
}

}  // namespace
}  // namespace gimnet::hub
