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
    EXPECT_TRUE(membership_.services().subscribe(session.index, name, effects_));
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
  const std::uint32_t index = robot.index;
  publisher_.publish_node(index, membership_);
  EXPECT_EQ(nodes_.find(index), (NodePlace{robot.place.shard, robot.place.slot, robot.place.generation}));
  membership_.connection_ended(robot, {true, proto::GoodbyeCode::done, ""}, 0ms, effects_);
  publisher_.publish_node(index, membership_);
  EXPECT_FALSE(nodes_.find(index).exists());
}

TEST_F(TablePublisherTest, PublishesTheMembersOfAGroupByShard) {
  const Session& robot = join("robot");
  const Session& viewer = join("viewer");
  ASSERT_NE(robot.place.shard, viewer.place.shard);
  ASSERT_TRUE(membership_.services().advertise(robot.index, "robot/odom", {}, 0ms, effects_));
  publisher_.publish_group(1, membership_);
  ASSERT_NE(groups_.find(1), nullptr);
  EXPECT_EQ(groups_.find(1)->provider, make_id<NodeId>(HubId{7}, robot.index));
  EXPECT_EQ(groups_.find(1)->provider_shard, robot.place.shard);
  ASSERT_EQ(groups_.find(1)->by_shard.size(), 2u);
  subscribe(viewer, "robot/odom");
  publisher_.publish_group(1, membership_);
  const auto& members = groups_.find(1)->by_shard[viewer.place.shard.value()];
  ASSERT_EQ(members.size(), 1u);
  EXPECT_EQ(members[0].slot, viewer.place.slot);
  EXPECT_EQ(members[0].generation, viewer.place.generation);
  EXPECT_TRUE(groups_.find(1)->by_shard[robot.place.shard.value()].empty());
}

TEST_F(TablePublisherTest, PublishesWhichServicesTakeData) {
  const Session& robot = join("robot");
  ASSERT_TRUE(membership_.services().advertise(robot.index, "robot/odom", {}, 0ms, effects_));
  ServiceTerms terms;
  terms.direction = static_cast<std::uint8_t>(proto::ns::Direction::accepts);
  ASSERT_TRUE(membership_.services().advertise(robot.index, "robot/drive", terms, 0ms, effects_));
  for (const std::uint32_t group : {1u, 2u}) publisher_.publish_group(group, membership_);
  EXPECT_FALSE(groups_.find(1)->accepts);
  EXPECT_TRUE(groups_.find(2)->accepts);
}

TEST_F(TablePublisherTest, AGroupEndsInTwoStepsWhereItHasMembersElsewhere) {
  const Session& robot = join("robot");
  const Session& far = join("far");
  const Session& near = join("near");
  ASSERT_NE(robot.place.shard, far.place.shard);
  ASSERT_EQ(robot.place.shard, near.place.shard);
  ASSERT_TRUE(membership_.services().advertise(robot.index, "robot/odom", {}, 0ms, effects_));
  subscribe(near, "robot/odom");
  publisher_.publish_group(1, membership_);
  EXPECT_FALSE(publisher_.end_group(1)) << "nothing can be on its way";
  EXPECT_EQ(groups_.find(1), nullptr);
  subscribe(far, "robot/odom");
  publisher_.publish_group(1, membership_);
  EXPECT_EQ(publisher_.end_group(1), robot.place.shard);
  ASSERT_NE(groups_.find(1), nullptr);
  EXPECT_TRUE(groups_.find(1)->ends());
  EXPECT_EQ(groups_.find(1)->by_shard[far.place.shard.value()].size(), 1u);
  publisher_.clear_group(1);
  EXPECT_EQ(groups_.find(1), nullptr);
  EXPECT_FALSE(publisher_.end_group(1));
}

TEST_F(TablePublisherTest, FreesOldMembersOnlyWhenNoShardCanLookAtThem) {
  const Session& robot = join("robot");
  ASSERT_TRUE(membership_.services().advertise(robot.index, "robot/odom", {}, 0ms, effects_));
  publisher_.publish_group(1, membership_);
  quiescence_.enter(0);
  const GroupMembers* seen = groups_.find(1);
  publisher_.publish_group(1, membership_);
  EXPECT_EQ(publisher_.garbage(), 1u);
  EXPECT_TRUE(publisher_.collect());
  EXPECT_EQ(seen->provider, make_id<NodeId>(HubId{7}, robot.index));  // still there, as a sanitizer would tell
  quiescence_.enter(0);
  EXPECT_FALSE(publisher_.collect());
  EXPECT_EQ(publisher_.garbage(), 0u);
}

TEST_F(TablePublisherTest, AWithdrawnGroupIsNoGroup) {
  const Session& robot = join("robot");
  ASSERT_TRUE(membership_.services().advertise(robot.index, "robot/odom", {}, 0ms, effects_));
  publisher_.publish_group(1, membership_);
  ASSERT_FALSE(membership_.services().withdraw(robot.index, 1, 0ms, effects_));
  publisher_.publish_group(1, membership_);
  EXPECT_EQ(groups_.find(1), nullptr);
  EXPECT_EQ(publisher_.garbage(), 0u);
  publisher_.publish_group(2, membership_);
  EXPECT_EQ(groups_.find(2), nullptr);
}

}  // namespace
}  // namespace gimnet::hub
