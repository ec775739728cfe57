#include "hub/control/table_publisher.hpp"

#include <gtest/gtest.h>

#include "proto/control/ns.hpp"

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;

class TablePublisherTest : public ::testing::Test {
 protected:
  Session& join(const std::string& name) {
    JoinRequest request;
    request.name = name;
    const auto joined = membership_.join(request, 0ms, effects_);
    EXPECT_TRUE(joined);
    return *joined->session;
  }
  void subscribe(const Session& session, const std::string& name) {
    EXPECT_TRUE(membership_.services().subscribe(session.index, name, {}, effects_));
  }
  void publish_member(NodeIndex node) {
    publisher_.publish_members(GroupIndex{1}, {&node, 1}, membership_);
  }

  Limits limits_;
  Membership membership_{Sessions::Options{HubId{7}, 2, Placement::spread}, limits_};
  Effects effects_;
  NodeTable nodes_;
  GroupTable groups_;
  Quiescence quiescence_{2};
  TablePublisher publisher_{HubId{7}, 2, {nodes_, groups_, quiescence_}};
};

TEST_F(TablePublisherTest, PublishesWhereANodeLivesAndThatItLeft) {
  Session& robot = join("robot");
  const NodeIndex index = robot.index;
  publisher_.publish_node(index, membership_);
  EXPECT_EQ(nodes_.find(index.value()),
            (NodePlace{robot.place.shard, robot.place.slot, robot.place.generation}));
  membership_.connection_ended(robot, {true, proto::GoodbyeCode::done, ""}, 0ms, effects_);
  publisher_.publish_node(index, membership_);
  EXPECT_FALSE(nodes_.find(index.value()).exists());
}

TEST_F(TablePublisherTest, PublishesTheMembersOfAGroupByShard) {
  const Session& robot = join("robot");
  const Session& viewer = join("viewer");
  ASSERT_NE(robot.place.shard, viewer.place.shard);
  ASSERT_TRUE(membership_.services().advertise(robot.index, "robot/odom", {}, 0ms, effects_));
  publisher_.publish_group(GroupIndex{1}, membership_);
  ASSERT_NE(groups_.find(1), nullptr);
  EXPECT_EQ(groups_.find(1)->provider, make_id(HubId{7}, robot.index));
  EXPECT_EQ(groups_.find(1)->provider_place,
            (NodePlace{robot.place.shard, robot.place.slot, robot.place.generation}));
  ASSERT_EQ(groups_.find(1)->by_shard.size(), 2u);
  subscribe(viewer, "robot/odom");
  publisher_.publish_group(GroupIndex{1}, membership_);
  EXPECT_TRUE(groups_.find(1)->by_shard[viewer.place.shard.value()].empty()) << "it joins later";
  publish_member(viewer.index);
  const auto& members = groups_.find(1)->by_shard[viewer.place.shard.value()];
  ASSERT_EQ(members.size(), 1u);
  ASSERT_NE(members.find(viewer.place.slot), nullptr);
  EXPECT_EQ(members.find(viewer.place.slot)->generation, viewer.place.generation);
  EXPECT_TRUE(groups_.find(1)->by_shard[robot.place.shard.value()].empty());
}

TEST_F(TablePublisherTest, PublishesWhichServicesTakeData) {
  const Session& robot = join("robot");
  ASSERT_TRUE(membership_.services().advertise(robot.index, "robot/odom", {}, 0ms, effects_));
  ServiceTerms terms;
  terms.direction = proto::ns::Direction::accepts;
  ASSERT_TRUE(membership_.services().advertise(robot.index, "robot/drive", terms, 0ms, effects_));
  for (const std::uint32_t group : {1u, 2u})
    publisher_.publish_group(GroupIndex{group}, membership_);
  EXPECT_FALSE(groups_.find(1)->accepts);
  EXPECT_TRUE(groups_.find(2)->accepts);
}

TEST_F(TablePublisherTest, AnotherProviderIsPublishedAloneAndTheMembersStay) {
  const Session& robot = join("robot");
  const Session& far = join("far");
  ASSERT_TRUE(membership_.services().advertise(robot.index, "robot/odom", {}, 0ms, effects_));
  subscribe(far, "robot/odom");
  publisher_.publish_group(GroupIndex{1}, membership_);
  publish_member(far.index);
  const GroupMembers* before = groups_.find(1);
  EXPECT_TRUE(groups_.find(1)->provided());
  ASSERT_FALSE(membership_.services().withdraw(robot.index, GroupIndex{1}, 0ms, effects_));
  publisher_.publish_group(GroupIndex{1}, membership_);
  ASSERT_NE(groups_.find(1), before);
  EXPECT_FALSE(groups_.find(1)->provided());
  EXPECT_FALSE(groups_.find(1)->provider_place.exists());
  EXPECT_EQ(groups_.find(1)->by_shard[far.place.shard.value()].size(), 1u);
  ASSERT_TRUE(membership_.services().advertise(far.index, "robot/odom", {}, 0ms, effects_));
  publisher_.publish_group(GroupIndex{1}, membership_);
  EXPECT_EQ(index_of(groups_.find(1)->provider), far.index.value());
  EXPECT_EQ(groups_.find(1)->provider_place.shard, far.place.shard);
}

TEST_F(TablePublisherTest, OneMemberMoreOrLessIsPublishedAloneAndTheListBeforeStaysAsItWas) {
  const Session& robot = join("robot");
  const Session& far = join("far");
  const Session& near = join("near");
  ASSERT_TRUE(membership_.services().advertise(robot.index, "robot/odom", {}, 0ms, effects_));
  publish_member(far.index);
  EXPECT_EQ(groups_.find(1), nullptr) << "the group comes first";
  publisher_.publish_group(GroupIndex{1}, membership_);
  quiescence_.enter(0);
  subscribe(far, "robot/odom");
  subscribe(near, "robot/odom");
  publish_member(far.index);
  const GroupMembers* before = groups_.find(1);
  EXPECT_EQ(before->by_shard[far.place.shard.value()].size(), 1u);
  EXPECT_TRUE(before->by_shard[near.place.shard.value()].empty()) << "its own effect is to come";
  publish_member(near.index);
  EXPECT_EQ(groups_.find(1)->by_shard[near.place.shard.value()].size(), 1u);
  ASSERT_FALSE(membership_.services().unsubscribe(far.index, "robot/odom", 0ms, effects_));
  publish_member(far.index);
  EXPECT_TRUE(groups_.find(1)->by_shard[far.place.shard.value()].empty());
  EXPECT_EQ(before->by_shard[far.place.shard.value()].size(), 1u);
  EXPECT_EQ(groups_.find(1)->provider, make_id(HubId{7}, robot.index));
}

TEST_F(TablePublisherTest, AMemberThatIsPacedIsInTheOtherList) {
  const Session& robot = join("robot");
  const Session& viewer = join("viewer");
  ASSERT_TRUE(membership_.services().advertise(robot.index, "robot/odom", {}, 0ms, effects_));
  publisher_.publish_group(GroupIndex{1}, membership_);
  const auto paced = [&]() -> const PacedMember* {
    const auto& lists = groups_.find(1)->paced_by_shard;
    return lists.empty() ? nullptr : lists[viewer.place.shard.value()].find(viewer.place.slot);
  };
  const auto want = [&](const SubscriberTerms& terms) {
    ASSERT_TRUE(membership_.services().subscribe(viewer.index, "robot/odom", terms, effects_));
    publish_member(viewer.index);
  };
  want({});
  EXPECT_EQ(paced(), nullptr);
  want({.interval_us = 1'000});
  ASSERT_NE(paced(), nullptr);
  EXPECT_TRUE(paced()->was_plain);
  EXPECT_TRUE(groups_.find(1)->by_shard[viewer.place.shard.value()].empty());
  ASSERT_FALSE(membership_.services().unsubscribe(viewer.index, "robot/odom", 0ms, effects_));
  publish_member(viewer.index);
  EXPECT_TRUE(groups_.find(1)->paced_by_shard.empty()) << "a group without any pays nothing for it";
}

TEST_F(TablePublisherTest, ManyMembersArePublishedInOneStep) {
  const Session& robot = join("robot");
  ASSERT_TRUE(membership_.services().advertise(robot.index, "robot/odom", {}, 0ms, effects_));
  publisher_.publish_group(GroupIndex{1}, membership_);
  std::vector<NodeIndex> some;
  for (int i = 0; i < 10; ++i) {
    const Session& viewer = join("viewer-" + std::to_string(i));
    subscribe(viewer, "robot/odom");
    if (i % 2 == 0) some.push_back(viewer.index);
  }
  quiescence_.enter(0);
  publisher_.publish_members(GroupIndex{1}, some, membership_);
  EXPECT_EQ(publisher_.garbage(), 1u);
  const auto& lists = groups_.find(1)->by_shard;
  EXPECT_EQ(lists[0].size() + lists[1].size(), some.size());
  publisher_.publish_members(GroupIndex{1}, some, membership_);
  EXPECT_EQ(groups_.find(1)->by_shard[0].size() + groups_.find(1)->by_shard[1].size(), some.size())
      << "once more is no other member";
}

TEST_F(TablePublisherTest, AMemberWhoseSessionIsOverIsFoundWhereItLived) {
  const Session& robot = join("robot");
  Session& viewer = join("viewer");
  const NodeIndex index = viewer.index;
  const Place place = viewer.place;
  publisher_.publish_node(index, membership_);
  ASSERT_TRUE(membership_.services().advertise(robot.index, "robot/odom", {}, 0ms, effects_));
  subscribe(viewer, "robot/odom");
  publisher_.publish_group(GroupIndex{1}, membership_);
  publish_member(index);
  ASSERT_EQ(groups_.find(1)->by_shard[place.shard.value()].size(), 1u);
  membership_.connection_ended(viewer, {true, proto::GoodbyeCode::done, ""}, 0ms, effects_);
  ASSERT_EQ(membership_.sessions().find(index), nullptr);
  publish_member(index);
  EXPECT_TRUE(groups_.find(1)->by_shard[place.shard.value()].empty());
}

TEST_F(TablePublisherTest, FreesOldMembersOnlyWhenNoShardCanLookAtThem) {
  const Session& robot = join("robot");
  ASSERT_TRUE(membership_.services().advertise(robot.index, "robot/odom", {}, 0ms, effects_));
  publisher_.publish_group(GroupIndex{1}, membership_);
  quiescence_.enter(0);
  const GroupMembers* seen = groups_.find(1);
  publisher_.publish_group(GroupIndex{1}, membership_);
  publisher_.collect();
  EXPECT_EQ(publisher_.garbage(), 1u);
  EXPECT_EQ(seen->provider,
            make_id(HubId{7}, robot.index));  // still there, as a sanitizer would tell
  quiescence_.enter(0);
  publisher_.collect();
  EXPECT_EQ(publisher_.garbage(), 0u);
}

TEST_F(TablePublisherTest, AGroupThatWasGivenBackIsNoGroup) {
  const Session& robot = join("robot");
  ASSERT_TRUE(membership_.services().advertise(robot.index, "robot/odom", {}, 0ms, effects_));
  publisher_.publish_group(GroupIndex{1}, membership_);
  ASSERT_FALSE(membership_.services().withdraw(robot.index, GroupIndex{1}, 0ms, effects_));
  publisher_.publish_group(GroupIndex{1}, membership_);
  EXPECT_FALSE(groups_.find(1)->provided());
  membership_.topics().tick(24h, effects_);
  publisher_.publish_group(GroupIndex{1}, membership_);
  EXPECT_EQ(groups_.find(1), nullptr);
  EXPECT_EQ(publisher_.garbage(), 0u);
  publisher_.publish_group(GroupIndex{2}, membership_);
  EXPECT_EQ(groups_.find(2), nullptr);
}

}  // namespace
}  // namespace gimnet::hub
