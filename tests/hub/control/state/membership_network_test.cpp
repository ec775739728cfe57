#include <gtest/gtest.h>

#include "hub/control/state/membership.hpp"
#include "hub/network/state/name_copies.hpp"

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
           proto::route::NameState state = proto::route::NameState::held) {
    proto::route::NameClaim claim;
    claim.version = ++version_;
    claim.node = make_id<NodeId>(kOther.hub, node);
    claim.state = state;
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

TEST_F(MembershipNetworkTest, ANodeThatComesFromAHubThatIsAwayHasItsNameAtOnce) {
  put("robot", 1);
  JoinRequest request;
  request.name = "robot";
  request.identity = Identity::open();
  request.former = make_id<NodeId>(kOther.hub, 1);
  EXPECT_FALSE(membership_.join(request, 1s, effects_)) << "its hub can be asked";
  (void)names_.set_reachable({}, milliseconds(0));
  request.former = make_id<NodeId>(kOther.hub, 2);
  EXPECT_FALSE(membership_.join(request, 1s, effects_)) << "it was another node's";
  request.former = make_id<NodeId>(kOther.hub, 1);
  EXPECT_TRUE(membership_.join(request, 1s, effects_));
}

TEST_F(MembershipNetworkTest, AnOlderClaimOfAHubThatIsAwayDoesNotStopANodeThatMoves) {
  put("robot", 1);
  JoinRequest request;
  request.name = "robot";
  request.identity = Identity::open();
  request.had_name = true;
  EXPECT_FALSE(membership_.join(request, 1s, effects_)) << "its hub can be reached";
  (void)names_.set_reachable({}, milliseconds(0));
  EXPECT_TRUE(membership_.join(request, 1s, effects_));
}

TEST_F(MembershipNetworkTest, ANameThatItsHubLetGoOfIsFreeAndHasTheHigherRank) {
  put("robot", 1);
  names_.note_let_go("robot", kOther.hub);
  Session* node = join("robot");
  ASSERT_NE(node, nullptr);
  proto::route::NameClaim claim;
  claim.node = make_id(HubId{7}, node->index);
  names_.put_own("robot", claim);
  EXPECT_EQ(names_.find("robot")->claim->node, claim.node);
  EXPECT_EQ(names_.find("robot")->claim->rank,
            names_.find_node(make_id<NodeId>(kOther.hub, 1))->claim->rank + 1);
}

TEST_F(MembershipNetworkTest, ASessionIsLetGoForItsTokenAloneAndOnce) {
  Session* node = join("robot");
  membership_.sessions().renew_token(*node, 1s);
  const std::vector<std::byte> token = membership_.sessions().token_of(*node);
  const Place place = node->place;
  effects_.clear();
  EXPECT_FALSE(membership_.let_go({token, "robot", Identity::of_user(7), 1s}, 1s, effects_));
  EXPECT_TRUE(effects_.empty());
  EXPECT_TRUE(membership_.let_go({token, "robot", Identity::open(), 1s}, 1s, effects_));
  EXPECT_FALSE(membership_.directory().find("robot"));
  const auto* closed = std::get_if<CloseDue>(&effects_.front());
  ASSERT_NE(closed, nullptr);
  EXPECT_EQ(closed->place.slot, place.slot);
  EXPECT_EQ(closed->code, proto::GoodbyeCode::replaced);
  EXPECT_FALSE(membership_.let_go({token, "robot", Identity::open(), 1s}, 1s, effects_));
}

TEST_F(MembershipNetworkTest, ATokenDoesNotLetGoOfTheNameOfAnother) {
  ASSERT_TRUE(
      membership_.services().advertise(join("robot")->index, "robot/odom", {}, 1s, effects_));
  for (const char* name : {"robot", "robot/odom"}) {
    Session* node = join("mine");
    membership_.sessions().renew_token(*node, 1s);
    const std::vector<std::byte> token = membership_.sessions().token_of(*node);
    EXPECT_FALSE(membership_.let_go({token, name, Identity::open(), 1s}, 1s, effects_)) << name;
    EXPECT_FALSE(membership_.directory().find("mine")) << "it has moved, whatever its name is";
  }
  EXPECT_TRUE(membership_.directory().find("robot"));
}

TEST_F(MembershipNetworkTest, ANodeThatLosesItsNameGoesOnAndAServiceEnds) {
  Session* node = join("robot");
  ASSERT_TRUE(membership_.services().advertise(node->index, "robot/laser", {}, 1s, effects_));
  effects_.clear();
  membership_.lose_name("robot/laser", NodeId{9}, "it was first", 1s, effects_);
  EXPECT_EQ(membership_.topics().provided(), 0u);
  EXPECT_EQ(std::get<NameLossDue>(effects_.back()).name, "robot/laser");
  membership_.lose_name("robot", NodeId{9}, "it was first", 1s, effects_);
  EXPECT_EQ(node->name, "") << "it goes on, by its id";
  EXPECT_FALSE(membership_.directory().find("robot"));
  EXPECT_EQ(std::get<NameLossDue>(effects_.back()).node, node->index);
  effects_.clear();
  membership_.lose_name("nobody", NodeId{9}, "", 1s, effects_);
  EXPECT_TRUE(effects_.empty());
}

}  // namespace
}  // namespace gimnet::hub
