#include "hub/control/state/directory.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "hub/control/state/topics.hpp"
#include "hub/network/state/name_copies.hpp"

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::HasSubstr;

class DirectoryTest : public ::testing::Test {
 protected:
  Session& hold(const std::string& name) {
    const auto created = sessions_.create(std::nullopt, 0ms);
    EXPECT_TRUE(created);
    Session& session = **created;
    session.name = name;
    session.origin = PeerAddress{"tcp", "127.0.0.1:5000"};
    sessions_.attach(session, 0ms);
    directory_.put(name, session.index);
    return session;
  }

  Limits limits_;
  Sessions sessions_{Sessions::Options{HubId{7}, 1, Placement::spread}, limits_};
  Topics topics_{HubId{7}, limits_};
  Directory directory_{sessions_, topics_};
};

TEST_F(DirectoryTest, FindsWhoHoldsAName) {
  const Session& robot = hold("robot");
  EXPECT_EQ(directory_.find("robot"), robot.index);
  EXPECT_EQ(directory_.find("rob"), std::nullopt);
  directory_.remove("robot");
  EXPECT_EQ(directory_.find("robot"), std::nullopt);
  directory_.remove("robot");
  EXPECT_EQ(directory_.size(), 0u);
}

TEST_F(DirectoryTest, ALiveHolderKeepsItsName) {
  hold("robot");
  const auto refusal = directory_.refusal("robot", {}, 12s);
  ASSERT_TRUE(refusal);
  EXPECT_EQ(refusal->code, proto::GoodbyeCode::name_taken);
  EXPECT_THAT(refusal->sentence, AllOf(HasSubstr("'robot'"), HasSubstr("7.1"),
                                       HasSubstr("127.0.0.1:5000"), HasSubstr("12 s")));
}

TEST_F(DirectoryTest, AnAbsentHolderDoesNot) {
  Session& robot = hold("robot");
  sessions_.begin_grace(robot, 1s);
  EXPECT_FALSE(directory_.refusal("robot", {}, 2s));
}

TEST_F(DirectoryTest, TheHolderItselfMayHaveIt) {
  const Session& robot = hold("robot");
  EXPECT_FALSE(directory_.refusal("robot", {&robot}, 0ms));
}

TEST_F(DirectoryTest, AFreeNameIsFree) { EXPECT_FALSE(directory_.refusal("robot", {}, 0ms)); }

TEST_F(DirectoryTest, BadNamesAreToldWhichRuleTheyBreak) {
  const auto refusal = directory_.refusal("a b", {}, 0ms);
  ASSERT_TRUE(refusal);
  EXPECT_EQ(refusal->code, proto::GoodbyeCode::bad_name);
  EXPECT_FALSE(directory_.refusal(std::string(255, 'a'), {}, 0ms));
  EXPECT_TRUE(directory_.refusal(std::string(256, 'a'), {}, 0ms));
  const auto id = directory_.refusal("7.1", {}, 0ms);
  ASSERT_TRUE(id);
  EXPECT_EQ(id->code, proto::GoodbyeCode::bad_name);
  EXPECT_EQ(id->sentence,
            "the name '7.1' cannot be taken: it reads as the id of a node does, NUMBER.NUMBER; "
            "choose another one");
  const auto hostile = directory_.refusal("\x1b[2J", {}, 0ms);
  ASSERT_TRUE(hostile);
  EXPECT_THAT(hostile->sentence, HasSubstr("\\x1b"));
}

TEST_F(DirectoryTest, AgesAreToldInFittingUnits) {
  hold("robot");
  EXPECT_THAT(directory_.refusal("robot", {}, 119s)->sentence, HasSubstr("119 s"));
  EXPECT_THAT(directory_.refusal("robot", {}, 120s)->sentence, HasSubstr("2 min"));
  EXPECT_THAT(directory_.refusal("robot", {}, 3h)->sentence, HasSubstr("3 h"));
}

/// Hub 9 as a copy of its names shows it.
class DirectoryNetworkTest : public DirectoryTest {
 protected:
  DirectoryNetworkTest() {
    (void)names_.set_reachable(std::vector<HubRun>{kOther}, 0ms);
    directory_.join_network(names_);
  }
  void put(const std::string& name, std::uint32_t node, GroupId group = {}) {
    proto::route::NameClaim claim;
    claim.version = ++version_;
    claim.node = make_id<NodeId>(kOther.hub, node);
    if (group != GroupId{}) claim.service.emplace().group = group;
    (void)names_.take({kOther.hub, kOther.instance, version_ - 1, version_, 0, {{name, claim}}});
  }
  static constexpr HubRun kOther{HubId{9}, proto::HubInstance{99}};
  NameCopies names_{{{HubId{7}, proto::HubInstance{1}}}};
  std::uint64_t version_ = 0;
};

TEST_F(DirectoryNetworkTest, ANameOfAnotherHubIsTaken) {
  put("robot", 1);
  EXPECT_THAT(directory_.refusal("robot", {}, 0ms)->sentence, HasSubstr("node 9.1 of hub 9"));
  EXPECT_FALSE(directory_.in_use("robot")) << "at this hub";
}

TEST_F(DirectoryNetworkTest, AnUnreachableNameIsRefusedWithTheTimeThatIsLeft) {
  put("robot", 1);
  (void)names_.set_reachable({}, 0ms);
  EXPECT_THAT(directory_.refusal("robot", {}, 10s)->sentence, HasSubstr("free in 20 s"));
  const auto former = make_id<NodeId>(kOther.hub, 1);
  EXPECT_FALSE(directory_.refusal("robot", {nullptr, former, false}, 10s));
  EXPECT_FALSE(directory_.refusal("robot", {nullptr, {}, true}, 10s));
}

TEST_F(DirectoryNetworkTest, NodesAndFullNamesOfServicesExcludeEachOther) {
  put("robot/laser", 1, make_id<GroupId>(kOther.hub, 1));
  put("other/laser", 2);
  EXPECT_TRUE(directory_.refusal("robot/laser", {}, 1s));
  EXPECT_TRUE(directory_.service_refusal("other/laser"));
  EXPECT_FALSE(directory_.service_refusal("robot/laser")) << "the node's name decides";
  const Session& node = hold("mine/laser");
  EXPECT_TRUE(directory_.service_refusal("mine/laser"));
  Effects effects;
  ASSERT_TRUE(topics_.provide("mine/odom", node.index, {}, 1s, effects));
  EXPECT_TRUE(directory_.refusal("mine/odom", {}, 1s));
  EXPECT_TRUE(directory_.in_use("mine/odom"));
}

}  // namespace
}  // namespace gimnet::hub
