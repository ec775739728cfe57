#include "hub/data/fanout/fanout.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <span>

#include "tests/hub/data/support/route_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::DropReason;
using proto::Kind;
using ::testing::ElementsAre;
using testing::RouteRig;
using testing::TestFrame;

constexpr std::uint32_t kHub = 7u << 20;

std::string with_ids(const std::vector<std::uint32_t>& ids, const std::string& payload) {
  std::string text(4 * ids.size(), '\0');
  std::memcpy(text.data(), ids.data(), text.size());
  return text + payload;
}

/// The mailbox of shard 1 is full, so that what is handed over to it is dropped.
class ShardRecipientsTest : public ::testing::Test {
 protected:
  ShardRecipientsTest() {
    for (std::uint32_t index = 10; index < 13; ++index) rig.add_there(index);
    for (int i = 0; i < 2; ++i) rig.route(kHub | 10, {"fills it"});
  }
  void TearDown() override {
    EXPECT_THAT(rig.take_mail(), ElementsAre(1u, 1u)) << "and nothing else";
    EXPECT_TRUE(rig.ledger_exact());
  }
  static Limits few_entries() {
    Limits limits;
    limits.mailbox_entries = 2;
    return limits;
  }
  std::uint64_t dropped(DropReason reason = DropReason::shard_full) {
    return rig.egress.dropped(reason);
  }
  RouteRig rig{few_entries()};
};

TEST_F(ShardRecipientsTest, AFrameToAGroupIsDroppedForEachMember) {
  rig.add_here(2);
  rig.publish_group(5, 1, {2}, {10, 11, 12});
  rig.route(kHub | 5, {"one", "two"}, {.kind = Kind::group});
  EXPECT_EQ(dropped(), 6u);
  EXPECT_EQ(rig.egress.tally.copies, 6u) << "2 frames to 4";
}

TEST_F(ShardRecipientsTest, PacedMembersCountAsMuch) {
  rig.publish_group(5, 1, {}, {10});
  rig.members.paced_by_shard.assign(2, {});
  rig.members.paced_by_shard[1].put({ConnectionSlot{11}, 11});
  rig.members.paced_by_shard[1].put({ConnectionSlot{12}, 12});
  rig.route(kHub | 5, {"one"}, {.kind = Kind::group});
  EXPECT_EQ(dropped(), 3u);
}

TEST_F(ShardRecipientsTest, ABroadcastIsDroppedForEachNode) {
  rig.add_here(2);
  rig.route(kHub | kEveryIndex, {"x"}, {.kind = Kind::broadcast});
  EXPECT_EQ(dropped(), 3u);
  rig.nodes.publish(12, {});
  rig.route(kHub | kEveryIndex, {"x"}, {.kind = Kind::broadcast});
  EXPECT_EQ(dropped(), 5u);
}

TEST_F(ShardRecipientsTest, AListIsDroppedForEachOfItsNodesThere) {
  rig.add_here(2);
  rig.route(5, {with_ids({6u << 20 | 10, kHub | 2, kHub | 10, kHub | 12, kHub | 99}, "x")},
            {.kind = Kind::list});
  EXPECT_EQ(dropped(), 2u);
  EXPECT_EQ(dropped(DropReason::no_such_node), 1u);
  EXPECT_EQ(dropped(DropReason::no_route), 1u);
  EXPECT_EQ(rig.egress.tally.copies, 4u);
}

TEST_F(ShardRecipientsTest, WhatIsForOneIsDroppedOnce) {
  rig.publish_group(5, 10, {}, {}, true);
  constexpr std::uint8_t kDrop = 2;
  rig.route(kHub | 5, {"x"}, {.kind = Kind::service, .flags = kDrop});
  rig.route(kHub | 11, {"x"}, {.flags = kDrop});
  EXPECT_EQ(dropped(), 2u);
}

TEST_F(ShardRecipientsTest, OneWhoLeftSinceIsNotCounted) {
  rig.publish_group(5, 1, {}, {10, 11});
  const hub::Run run = rig.make_run(kHub | 5, {"x"}, {.kind = Kind::group});
  rig.route(run);
  rig.members.by_shard[1].erase(ConnectionSlot{10});
  rig.fanout.post_all();
  EXPECT_EQ(dropped(), 1u);
  rig.route(rig.make_run(kHub | 5, {"x"}, {.kind = Kind::group}));
  rig.members.by_shard[1].erase(ConnectionSlot{11});
  rig.fanout.post_all();
  EXPECT_EQ(dropped(), 1u);
  EXPECT_EQ(dropped(DropReason::no_subscriber), 1u) << "as the other shard would say";
}

TEST_F(ShardRecipientsTest, AReportShowsTheListWithoutIds) {
  rig.add_here(2);
  const std::string sent = with_ids({kHub | 2, kHub | 10, kHub | 11, kHub | 12, kHub | 99}, "x");
  rig.route(5, {sent}, {.kind = Kind::list, .flags = proto::kFlagReport});
  int reports = 0;
  rig.egress.drops.flush(1'000, [&](NodeId, std::span<const std::byte> payload) {
    const auto report = proto::decode_report(payload);
    EXPECT_TRUE(report);
    if (!report) return false;
    ++reports;
    EXPECT_EQ(report->count, report->reason == DropReason::shard_full ? 3u : 1u);
    EXPECT_EQ(report->header.dst, 0u);
    EXPECT_EQ(report->header.length, 1u);
    EXPECT_EQ(std::memcmp(report->following.data(), "x", 1), 0);
    return true;
  });
  EXPECT_EQ(reports, 2) << "shard_full and no_such_node";
}

}  // namespace
}  // namespace gimnet::hub
