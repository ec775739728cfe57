#include "hub/control/state/directory.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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
  Directory directory_;
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
  const auto refusal = directory_.refusal("robot", nullptr, sessions_, 12s);
  ASSERT_TRUE(refusal);
  EXPECT_EQ(refusal->code, proto::GoodbyeCode::name_taken);
  EXPECT_THAT(refusal->sentence, AllOf(HasSubstr("'robot'"), HasSubstr("7.1"),
                                       HasSubstr("127.0.0.1:5000"), HasSubstr("12 s")));
}

TEST_F(DirectoryTest, AnAbsentHolderDoesNot) {
  Session& robot = hold("robot");
  sessions_.begin_grace(robot, 1s);
  EXPECT_FALSE(directory_.refusal("robot", nullptr, sessions_, 2s));
}

TEST_F(DirectoryTest, TheHolderItselfMayHaveIt) {
  const Session& robot = hold("robot");
  EXPECT_FALSE(directory_.refusal("robot", &robot, sessions_, 0ms));
}

TEST_F(DirectoryTest, AFreeNameIsFree) {
  EXPECT_FALSE(directory_.refusal("robot", nullptr, sessions_, 0ms));
}

TEST_F(DirectoryTest, BadNamesAreToldWhichRuleTheyBreak) {
  const auto refusal = directory_.refusal("a b", nullptr, sessions_, 0ms);
  ASSERT_TRUE(refusal);
  EXPECT_EQ(refusal->code, proto::GoodbyeCode::bad_name);
  EXPECT_FALSE(directory_.refusal(std::string(255, 'a'), nullptr, sessions_, 0ms));
  EXPECT_TRUE(directory_.refusal(std::string(256, 'a'), nullptr, sessions_, 0ms));
  const auto id = directory_.refusal("7.1", nullptr, sessions_, 0ms);
  ASSERT_TRUE(id);
  EXPECT_EQ(id->code, proto::GoodbyeCode::bad_name);
  EXPECT_EQ(id->sentence,
            "the name '7.1' cannot be taken: it reads as the id of a node does, NUMBER.NUMBER; "
            "choose another one");
  const auto hostile = directory_.refusal("\x1b[2J", nullptr, sessions_, 0ms);
  ASSERT_TRUE(hostile);
  EXPECT_THAT(hostile->sentence, HasSubstr("\\x1b"));
}

TEST_F(DirectoryTest, AgesAreToldInFittingUnits) {
  hold("robot");
  EXPECT_THAT(directory_.refusal("robot", nullptr, sessions_, 119s)->sentence, HasSubstr("119 s"));
  EXPECT_THAT(directory_.refusal("robot", nullptr, sessions_, 120s)->sentence, HasSubstr("2 min"));
  EXPECT_THAT(directory_.refusal("robot", nullptr, sessions_, 3h)->sentence, HasSubstr("3 h"));
}

}  // namespace
}  // namespace gimnet::hub
