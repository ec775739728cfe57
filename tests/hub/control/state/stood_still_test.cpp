#include <gtest/gtest.h>

#include <vector>

#include "hub/control/state/membership.hpp"

// Tests the times that run out while the hub itself stands still: stopped, starved, or with its
// disk.

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;
using proto::GoodbyeCode;

constexpr auto kGrace = 30s;

class StoodStill : public ::testing::Test {
 protected:
  static JoinRequest request(const std::string& name) {
    JoinRequest result;
    result.name = name;
    result.identity = Identity::open();
    return result;
  }
  NodeIndex join(const std::string& name) {
    const auto joined = membership_.join(request(name), 0ms, effects_);
    EXPECT_TRUE(joined);
    return joined ? joined->session->index : NodeIndex{};
  }
  void lose(NodeIndex index, std::chrono::milliseconds now) {
    membership_.connection_ended(*membership_.sessions().find(index),
                                 {false, GoodbyeCode::done, ""}, now, effects_);
  }
  bool is_member(NodeIndex index, std::chrono::milliseconds now) {
    membership_.tick(now, effects_);
    return membership_.sessions().find(index) != nullptr;
  }

  Limits limits_;
  Membership membership_{Sessions::Options{HubId{7}, 2, Placement::spread}, limits_};
  Effects effects_;
};

TEST_F(StoodStill, GraceTimesStandStillToo) {
  for (const std::string name : {"robot", "reader"}) {
    const NodeIndex robot = join(name);
    if (name == "reader") {
      ASSERT_TRUE(membership_.services().subscribe(robot, "robot/odom", {}, effects_));
    }
    lose(robot, 1s);
    membership_.stood_still(60s, 62s);
    EXPECT_EQ(membership_.next_deadline(), 91s);
    EXPECT_TRUE(is_member(robot, 91s - 1ms)) << name;
    EXPECT_FALSE(is_member(robot, 91s)) << name;
  }
}

TEST_F(StoodStill, WhatBeganMeanwhileHasAllItsTimeAndNoMore) {
  const NodeIndex early = join("early");
  const NodeIndex late = join("late");
  lose(early, 1s);
  lose(late, 61s);
  membership_.stood_still(60s, 62s);
  EXPECT_FALSE(is_member(early, 91s));
  EXPECT_TRUE(is_member(late, 62s + kGrace - 1ms));
  EXPECT_FALSE(is_member(late, 62s + kGrace));
}

TEST_F(StoodStill, WhoCameBackHasItsTimeToDeclare) {
  const NodeIndex robot = join("robot");
  ASSERT_TRUE(membership_.services().advertise(robot, "robot/odom", {}, 0ms, effects_));
  JoinRequest again = request("robot");
  const std::vector<std::byte> token =
      membership_.sessions().token_of(*membership_.sessions().find(robot));
  again.token = token;
  lose(robot, 1s);
  ASSERT_TRUE(membership_.join(again, 2s, effects_));
  membership_.stood_still(60s, 63s);
  membership_.tick(92s - 1ms, effects_);
  EXPECT_TRUE(membership_.topics().find_group(GroupIndex{1})->provided());
  membership_.tick(92s, effects_);
  EXPECT_FALSE(membership_.topics().find_group(GroupIndex{1})->provided());
}

TEST_F(StoodStill, AfterARestartThoseOfBeforeHaveTheirTime) {
  Sessions::Options options;
  options.hub = HubId{7};
  options.boot = 2;
  options.returns_until = kGrace;
  options.nodes.count = 0;
  for (std::uint32_t index = 1; index < kEveryIndex; ++index) options.nodes.used.insert(index);
  Membership restarted{options, limits_};
  restarted.stood_still(60s, 61s);
  EXPECT_EQ(restarted.sessions().returns_until(), 90s);
  EXPECT_EQ(restarted.sessions().indices().waits_for_returns(61s), 29s);
  EXPECT_FALSE(restarted.keeping_due(90s - 1ms)) << "those who may come back are not forgotten";
  EXPECT_TRUE(restarted.keeping_due(90s));
}

TEST_F(StoodStill, OfAHubsFirstStartNobodyIsExpectedAllTheSame) {
  membership_.stood_still(60s, 61s);
  EXPECT_EQ(membership_.sessions().returns_until(), std::nullopt);
  EXPECT_EQ(membership_.next_deadline(), std::nullopt);
}

}  // namespace
}  // namespace gimnet::hub
