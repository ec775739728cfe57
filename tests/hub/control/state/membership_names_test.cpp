#include <gtest/gtest.h>

#include "hub/control/state/membership.hpp"
#include "tests/hub/control/state/support/membership_rig.hpp"

// The names of nodes: another one while a node is there, and names that other hubs decide on.

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
  ASSERT_EQ(count<ServiceMoved>(), 1u);
  EXPECT_EQ(membership_.services().services_of(robot->index), 0u);
  EXPECT_EQ(membership_.services().provided(), 0u);
  EXPECT_EQ(membership_.services().topics(), 2u) << "both subscriptions wait on";
}

TEST_F(MembershipNamesTest, OneHubDecidesOnNamesAtOnce) {
  Session* robot = join("robot");
  EXPECT_FALSE(membership_.directory().is_provisional("robot"));
  effects_.clear();
  membership_.name_decided(*robot, {.confirmed = false, .holder = NodeId{9}, .sentence = "late"},
                           1s, effects_);
  EXPECT_TRUE(effects_.empty()) << "final is final";
  EXPECT_EQ(robot->name, "robot");
}

TEST_F(MembershipNamesTest, AProvisionalNameIsConfirmedOrLost) {
  membership_.decide_names(NameStanding::provisional);
  Session* robot = join("robot");
  Session* rival = join("rival");
  EXPECT_TRUE(membership_.directory().is_provisional("robot"));
  effects_.clear();
  membership_.name_decided(*robot, {}, 1s, effects_);
  EXPECT_FALSE(membership_.directory().is_provisional("robot"));
  ASSERT_EQ(effects_.size(), 1u);
  EXPECT_TRUE(std::get<NameDecided>(effects_[0]).confirmed);
  effects_.clear();
  membership_.name_decided(
      *rival, {.confirmed = false, .holder = NodeId{9}, .sentence = "it was first"}, 1s, effects_);
  EXPECT_EQ(rival->name, "") << "it goes on, by its id";
  EXPECT_FALSE(membership_.directory().find("rival"));
  const auto& lost = std::get<NameDecided>(effects_.back());
  EXPECT_FALSE(lost.confirmed);
  EXPECT_EQ(lost.name, "rival");
  EXPECT_EQ(lost.holder, NodeId{9});
}

}  // namespace
}  // namespace gimnet::hub
