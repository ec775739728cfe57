#include <gtest/gtest.h>

#include "hub/control/state/membership.hpp"

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;
using std::chrono::milliseconds;

/// Hub 9 as a copy of its names shows it.
class MembershipNetworkTest : public ::testing::Test {
 protected:
  MembershipNetworkTest() {
    (void)names_.set_reachable(std::vector<HubRun>{kOther}, milliseconds(0));
    membership_.join_network(names_);
  }
  Session* join(const std::string& name) {
    JoinRequest request;
    request.name = name;
    request.identity = Identity::open();
    const auto joined = membership_.join(request, 0ms, effects_);
    return joined ? joined->session : nullptr;
  }
  void put(const std::string& name, std::uint32_t node,
           proto::route::NameState state = proto::route::NameState::held, GroupId group = {}) {
    proto::route::NameClaim claim;
    claim.version = ++version_;
    claim.node = make_id<NodeId>(kOther.hub, node);
    claim.state = state;
    if (group != GroupId{}) claim.service.emplace().group = group;
    (void)names_.take({kOther.hub, kOther.instance, version_ - 1, version_, 0, {{name, claim}}});
  }
  static constexpr HubRun kOther{HubId{9}, proto::HubInstance{99}};
  NameCopies names_{{{HubId{7}, proto::HubInstance{1}}}};
  std::uint64_t version_ = 0;
  Limits limits_;
  Membership membership_{Sessions::Options{HubId{7}, 2, Placement::spread}, limits_};
  Effects effects_;
};

TEST_F(MembershipNetworkTest, NobodyGetsANameThatAnotherHubHolds) {
  put("robot", 1);
  Session* node = join("mine");
  const auto refusal = membership_.rename(*node, "robot", 1s, effects_);
  ASSERT_TRUE(refusal);
  EXPECT_EQ(refusal->status, proto::Status::taken);
  EXPECT_NE(refusal->sentence.find("node 9.1 of hub 9"), std::string::npos) << refusal->sentence;
  put("robot", 1, proto::route::NameState::away);
  EXPECT_FALSE(membership_.rename(*node, "robot", 1s, effects_)) << "its node is away";
}

TEST_F(MembershipNetworkTest, AnUnreachableNameIsRefusedWithTheTimeThatIsLeft) {
  put("robot", 1);
  (void)names_.set_reachable({}, milliseconds(0));
  const auto refusal = membership_.rename(*join("mine"), "robot", 10s, effects_);
  ASSERT_TRUE(refusal);
  EXPECT_NE(refusal->sentence.find("free in 20 s"), std::string::npos) << refusal->sentence;
}

TEST_F(MembershipNetworkTest, NodesAndFullNamesOfServicesExcludeEachOther) {
  put("robot/laser", 1, proto::route::NameState::held, make_id<GroupId>(kOther.hub, 1));
  put("other/laser", 2);
  Session* node = join("mine");
  EXPECT_TRUE(membership_.rename(*node, "robot/laser", 1s, effects_));
  EXPECT_TRUE(membership_.service_name_refusal("other/laser"));
  EXPECT_FALSE(membership_.service_name_refusal("robot/laser")) << "the node's name decides";
  join("mine/laser");
  EXPECT_TRUE(membership_.service_name_refusal("mine/laser"));
  ASSERT_TRUE(membership_.services().advertise(node->index, "mine/odom", {}, 1s, effects_));
  EXPECT_TRUE(membership_.rename(*join("third"), "mine/odom", 1s, effects_));
}

TEST_F(MembershipNetworkTest, ANodeThatLosesItsNameGoesOnAndAServiceEnds) {
  Session* node = join("robot");
  ASSERT_TRUE(membership_.services().advertise(node->index, "robot/laser", {}, 1s, effects_));
  effects_.clear();
  membership_.lose_name("robot/laser", NodeId{9}, "it was first", 1s, effects_);
  EXPECT_EQ(membership_.services().provided(), 0u);
  EXPECT_EQ(std::get<NameLost>(effects_.back()).name, "robot/laser");
  membership_.lose_name("robot", NodeId{9}, "it was first", 1s, effects_);
  EXPECT_EQ(node->name, "") << "it goes on, by its id";
  EXPECT_FALSE(membership_.directory().find("robot"));
  EXPECT_EQ(std::get<NameLost>(effects_.back()).node, node->index);
  effects_.clear();
  membership_.lose_name("nobody", NodeId{9}, "", 1s, effects_);
  EXPECT_TRUE(effects_.empty());
}

}  // namespace
}  // namespace gimnet::hub
