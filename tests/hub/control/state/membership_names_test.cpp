#include <gtest/gtest.h>

#include "hub/control/state/membership.hpp"
#include "tests/hub/control/state/support/membership_rig.hpp"

// The names of nodes: another one while a node is there.

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;

using MembershipNamesTest = MembershipTest;

TEST_F(MembershipNamesTest, ANodeChangesItsNameAndGivesItBack) {
  Session* robot = join("robot");
  ASSERT_FALSE(membership_.rename(*robot, "forklift", 1s, effects_));
  EXPECT_EQ(robot->name, "forklift");
  EXPECT_FALSE(membership_.directory().find("robot"));
  EXPECT_EQ(membership_.directory().find("forklift"), robot->index);
  effects_.clear();
  ASSERT_FALSE(membership_.rename(*robot, "forklift", 1s, effects_)) << "its own";
  EXPECT_TRUE(effects_.empty());
  ASSERT_FALSE(membership_.rename(*robot, "", 1s, effects_));
  EXPECT_EQ(membership_.directory().size(), 0u);
  EXPECT_NE(join("forklift"), nullptr);
}

TEST_F(MembershipNamesTest, ANewNameIsJudgedAsAtJoining) {
  Session* robot = join("robot");
  Session* rival = join("rival");
  const auto taken = membership_.rename(*robot, "rival", 1s, effects_);
  ASSERT_TRUE(taken);
  EXPECT_EQ(taken->status, proto::Status::taken);
  EXPECT_NE(taken->sentence.find("7.2"), std::string::npos) << taken->sentence;
  EXPECT_EQ(membership_.rename(*robot, "a//b", 1s, effects_)->status, proto::Status::bad_request);
  EXPECT_EQ(robot->name, "robot");
  lose(*rival, 1s);
  ASSERT_FALSE(membership_.rename(*robot, "rival", 2s, effects_)) << "who is away makes way";
  EXPECT_EQ(membership_.directory().find("rival"), robot->index);
  EXPECT_EQ(membership_.sessions().all().size(), 1u);
}

TEST_F(MembershipNamesTest, ANewNameWithdrawsWhatTheNodeProvides) {
  Session* robot = join("robot");
  Session* viewer = join("viewer");
  ASSERT_TRUE(membership_.services().advertise(robot->index, "robot/odom", {}, 0s, effects_));
  ASSERT_TRUE(membership_.services().subscribe(viewer->index, "robot/odom", {}, effects_));
  ASSERT_TRUE(membership_.services().subscribe(robot->index, "viewer/pose", {}, effects_));
  effects_.clear();
  ASSERT_FALSE(membership_.rename(*robot, "forklift", 1s, effects_));
  ASSERT_EQ(count<ServiceChanged>(), 1u);
  EXPECT_EQ(membership_.services().services_of(robot->index), 0u);
  EXPECT_EQ(membership_.services().provided(), 0u);
  EXPECT_EQ(membership_.services().topics(), 2u) << "both subscriptions wait on";
}

}  // namespace
}  // namespace gimnet::hub
