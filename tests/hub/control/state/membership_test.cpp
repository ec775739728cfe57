#include "hub/control/state/membership.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/control/state/support/membership_rig.hpp"

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;
using proto::GoodbyeCode;

constexpr auto kGrace = 30s;

TEST_F(MembershipTest, JoiningTakesANameAndAnId) {
  const Session* robot = join("robot");
  ASSERT_NE(robot, nullptr);
  EXPECT_EQ(membership_.directory().find("robot"), robot->index);
  EXPECT_TRUE(robot->connected);
  EXPECT_EQ(robot->attachment, 1u);
  ASSERT_EQ(effects_.size(), 1u);
  EXPECT_EQ(std::get<NodeNoted>(effects_[0]).kind, proto::ns::ChangeKind::joined);
}

TEST_F(MembershipTest, NodesMayHaveNoName) {
  EXPECT_NE(join(""), nullptr);
  EXPECT_NE(join(""), nullptr);
  EXPECT_EQ(membership_.directory().size(), 0u);
}

TEST_F(MembershipTest, ASecondLiveHolderOfANameIsRefused) {
  join("robot");
  EXPECT_EQ(refused(request("robot")), GoodbyeCode::name_taken);
  EXPECT_EQ(membership_.sessions().all().size(), 1u);
}

TEST_F(MembershipTest, ATokenBringsIdAndNameBackWithinTheGraceTime) {
  Session* robot = join("robot");
  const NodeIndex index = robot->index;
  lose(*robot, 1s);
  const std::vector<std::byte> token = token_of(*robot);
  JoinRequest again = request("");
  again.token = token;
  const auto joined = membership_.join(again, 1s + kGrace - 1ms, effects_);
  ASSERT_TRUE(joined);
  EXPECT_FALSE(joined->new_session);
  EXPECT_EQ(joined->session->index, index);
  EXPECT_EQ(joined->session->name, "robot");
  EXPECT_EQ(joined->session->attachment, 2u);
}

TEST_F(MembershipTest, AfterTheGraceTimeATokenBringsTheIdBackWhileItIsFree) {
  Session* robot = join("robot");
  const NodeIndex index = robot->index;
  const std::vector<std::byte> token = token_of(*robot);
  lose(*robot, 1s);
  EXPECT_EQ(membership_.next_deadline(), 1s + kGrace);
  membership_.tick(1s + kGrace, effects_);
  EXPECT_EQ(membership_.directory().find("robot"), std::nullopt);
  EXPECT_EQ(count<SessionEnded>(), 1u);
  JoinRequest again = request("robot");
  again.token = token;
  const auto joined = membership_.join(again, 2s + kGrace, effects_);
  ASSERT_TRUE(joined);
  EXPECT_TRUE(joined->new_session);
  EXPECT_EQ(joined->session->index, index);
  EXPECT_EQ(membership_.directory().find("robot"), index);
}

TEST_F(MembershipTest, AfterGoodbyeATokenCountsAsNone) {
  Session* robot = join("robot");
  const NodeIndex index = robot->index;
  const std::vector<std::byte> token = token_of(*robot);
  membership_.connection_ended(*robot, {true, GoodbyeCode::done, ""}, 1s, effects_);
  JoinRequest again = request("robot");
  again.token = token;
  const auto joined = membership_.join(again, 2s, effects_);
  ASSERT_TRUE(joined);
  EXPECT_NE(joined->session->index, index);
}

TEST_F(MembershipTest, AKickedNodesTokenCountsAsNoneAndIsRemembered) {
  Session* robot = join("robot");
  const NodeIndex index = robot->index;
  const std::vector<std::byte> token = token_of(*robot);
  membership_.kick(*robot, "kicked by an administrator", 1s, effects_);
  EXPECT_EQ(count<StateDue>(), 1u);
  EXPECT_EQ(count<CloseDue>(), 1u);
  EXPECT_EQ(count<SessionEnded>(), 1u);
  ASSERT_EQ(membership_.durable(0ms).kicked.size(), 1u);
  EXPECT_EQ(membership_.durable(0ms).kicked[0].index, index);
  JoinRequest again = request("robot");
  again.token = token;
  const auto joined = membership_.join(again, 2s, effects_);
  ASSERT_TRUE(joined);
  EXPECT_NE(joined->session->index, index);
}

TEST_F(MembershipTest, ALiveSessionMovesToItsNewerConnection) {
  Session* robot = join("robot");
  const std::vector<std::byte> token = token_of(*robot);
  JoinRequest again = request("robot");
  again.token = token;
  const auto joined = membership_.join(again, 1s, effects_);
  ASSERT_TRUE(joined);
  EXPECT_EQ(joined->session, robot);
  EXPECT_EQ(robot->attachment, 2u);
  EXPECT_EQ(membership_.sessions().connected(), 1u);
}

TEST_F(MembershipTest, ANewcomerTakesTheNameOfSomebodyAway) {
  Session* robot = join("robot");
  const NodeIndex index = robot->index;
  const std::vector<std::byte> token = token_of(*robot);
  lose(*robot, 1s);
  const Session* newcomer = join("robot", 2s);
  ASSERT_NE(newcomer, nullptr);
  EXPECT_NE(newcomer->index, index);
  EXPECT_EQ(count<SessionEnded>(), 1u);
  JoinRequest late = request("robot");
  late.token = token;
  EXPECT_EQ(refused(late, 3s), GoodbyeCode::name_taken);
}

TEST_F(MembershipTest, ANewcomerTakesThePlaceToo) {
  limits_.nodes = 1;
  Membership membership{Sessions::Options{HubId{7}, 1, Placement::spread}, limits_};
  const auto first = membership.join(request("robot"), 0ms, effects_);
  ASSERT_TRUE(first);
  membership.connection_ended(*first->session, {}, 1s, effects_);
  EXPECT_TRUE(membership.join(request("robot"), 2s, effects_));
}

TEST_F(MembershipTest, WhatANodeAcceptsIsAwayWhileItsNodeIs) {
  Session* robot = join("robot");
  ServiceTerms commands;
  commands.direction = proto::ns::Direction::accepts;
  const auto advertise = [&] {
    ASSERT_TRUE(membership_.services().advertise(robot->index, "robot/d", commands, 1s, effects_));
  };
  advertise();
  const LocalService& service = *membership_.topics().find("robot/d")->service;
  lose(*robot, 1s);
  EXPECT_TRUE(service.provider_away);
  JoinRequest again = request("robot");
  const std::vector<std::byte> token = token_of(*robot);
  again.token = token;
  ASSERT_TRUE(membership_.join(again, 2s, effects_));
  EXPECT_TRUE(service.provider_away);
  advertise();
  EXPECT_FALSE(service.provider_away);
  EXPECT_EQ(count<AcceptanceChanged>(), 2u);
}

TEST_F(MembershipTest, GoodbyeFreesNameAndIdAtOnce) {
  Session* robot = join("robot");
  membership_.connection_ended(*robot, {true, GoodbyeCode::done, ""}, 1s, effects_);
  EXPECT_EQ(count<SessionEnded>(), 1u);
  EXPECT_EQ(membership_.directory().find("robot"), std::nullopt);
  EXPECT_TRUE(membership_.sessions().all().empty());
}

TEST_F(MembershipTest, AGoodbyeWithAReasonKeepsTheGraceTime) {
  Session* robot = join("robot");
  membership_.connection_ended(*robot, {true, GoodbyeCode::silent, "lost you"}, 1s, effects_);
  EXPECT_FALSE(robot->connected);
  EXPECT_EQ(robot->closing, nullptr);
  EXPECT_EQ(membership_.sessions().all().size(), 1u);
}

TEST_F(MembershipTest, HowTheHubClosedIsRemembered) {
  Session* robot = join("robot");
  membership_.connection_ended(*robot, {false, GoodbyeCode::slow_consumer, "took too little"}, 1s,
                               effects_);
  ASSERT_NE(robot->closing, nullptr);
  EXPECT_EQ(robot->closing->code, GoodbyeCode::slow_consumer);
  EXPECT_EQ(robot->closing->sentence, "took too little");
}

TEST_F(MembershipTest, AReturningNodeMayTakeAnotherName) {
  Session* robot = join("robot");
  ASSERT_TRUE(membership_.services().advertise(robot->index, "robot/odom", {}, 0ms, effects_));
  const std::vector<std::byte> token = token_of(*robot);
  JoinRequest again = request("lifter");
  again.token = token;
  ASSERT_TRUE(membership_.join(again, 1s, effects_));
  EXPECT_EQ(membership_.directory().find("robot"), std::nullopt);
  EXPECT_EQ(membership_.directory().find("lifter"), robot->index);
  EXPECT_EQ(membership_.services().services_of(robot->index), 0u);
}

TEST_F(MembershipTest, AReturningNodeCannotTakeALiveNodesName) {
  join("viewer");
  Session* robot = join("robot");
  const std::vector<std::byte> token = token_of(*robot);
  JoinRequest again = request("viewer");
  again.token = token;
  EXPECT_EQ(refused(again), GoodbyeCode::name_taken);
  EXPECT_EQ(robot->name, "robot");
  EXPECT_EQ(robot->attachment, 1u);
}

TEST_F(MembershipTest, ServicesStayThroughTheGraceTimeAndGoWithIt) {
  Session* robot = join("robot");
  Session* viewer = join("viewer");
  ASSERT_TRUE(membership_.services().advertise(robot->index, "robot/odom", {}, 0ms, effects_));
  ASSERT_TRUE(membership_.services().subscribe(viewer->index, "robot/odom", {}, effects_));
  lose(*robot, 1s);
  membership_.tick(1s + kGrace - 1ms, effects_);
  EXPECT_NE(membership_.topics().find_group(GroupIndex{1}), nullptr);
  effects_.clear();
  membership_.tick(1s + kGrace, effects_);
  EXPECT_FALSE(membership_.topics().find_group(GroupIndex{1})->provided());
  EXPECT_EQ(count<ServiceChanged>(), 1u);
}

TEST_F(MembershipTest, WhatAReturnedNodeDoesNotDeclareAgainIsDropped) {
  Session* robot = join("robot");
  ASSERT_TRUE(membership_.services().advertise(robot->index, "robot/odom", {}, 0ms, effects_));
  ASSERT_TRUE(membership_.services().advertise(robot->index, "robot/scan", {}, 0ms, effects_));
  const std::vector<std::byte> token = token_of(*robot);
  lose(*robot, 1s);
  JoinRequest again = request("robot");
  again.token = token;
  ASSERT_TRUE(membership_.join(again, 2s, effects_));
  const auto odom = membership_.services().advertise(robot->index, "robot/odom", {}, 3s, effects_);
  ASSERT_TRUE(odom);
  EXPECT_EQ(odom->group, GroupIndex{1});
  membership_.tick(2s + kGrace, effects_);
  EXPECT_TRUE(membership_.topics().find_group(GroupIndex{1})->provided());
  EXPECT_FALSE(membership_.topics().find_group(GroupIndex{2})->provided());
}

TEST_F(MembershipTest, RolesAreAdmittedByWhoTheyAre) {
  JoinRequest hub = request("");
  hub.role = proto::Role::hub;
  EXPECT_EQ(refused(hub), GoodbyeCode::not_allowed);
  JoinRequest admin = request("");
  admin.role = proto::Role::admin;
  EXPECT_EQ(refused(admin), GoodbyeCode::not_allowed);
  admin.identity = Identity::of_user(1000);
  const auto by_socket = membership_.join(admin, 0ms, effects_);
  ASSERT_FALSE(by_socket);
  EXPECT_THAT(by_socket.error().sentence,
              ::testing::HasSubstr("this is uid 1000; run the command as one of them"));
  admin.rights.administer = true;
  EXPECT_EQ(refused(admin), GoodbyeCode::done);
  JoinRequest unknown = request("");
  unknown.role = static_cast<proto::Role>(9);
  EXPECT_EQ(refused(unknown), GoodbyeCode::not_allowed);
}

TEST_F(MembershipTest, AFullHubSaysSo) {
  for (int i = 0; i < 4; ++i) ASSERT_NE(join(""), nullptr);
  EXPECT_EQ(refused(request("")), GoodbyeCode::hub_full);
}

TEST_F(MembershipTest, ANamelessNodeClosedForWhatItSentIsForgottenAtOnce) {
  for (const GoodbyeCode code : {GoodbyeCode::malformed, GoodbyeCode::wrong_source,
                                 GoodbyeCode::not_allowed, GoodbyeCode::too_many_requests}) {
    effects_.clear();
    membership_.connection_ended(*join(""), {false, code, "why"}, 1s, effects_);
    EXPECT_EQ(count<SessionEnded>(), 1u);
    EXPECT_EQ(count<NodeChanged>(), 1u);
    EXPECT_TRUE(membership_.sessions().all().empty());
  }
}

TEST_F(MembershipTest, OthersWhoWereClosedKeepTheirGraceTime) {
  JoinRequest resuming = request("");
  resuming.resumes = true;
  membership_.connection_ended(*join("robot"), {false, GoodbyeCode::malformed, "why"}, 1s,
                               effects_);
  for (const Membership::Ending& ending :
       {Membership::Ending{false, GoodbyeCode::silent, "why"},
        Membership::Ending{true, GoodbyeCode::malformed, "your frame"}}) {
    const auto joined = membership_.join(resuming, 0ms, effects_);
    ASSERT_TRUE(joined);
    membership_.connection_ended(*joined->session, ending, 1s, effects_);
  }
  EXPECT_EQ(membership_.sessions().all().size(), 3u);
}

TEST_F(MembershipTest, ANodeWithNeitherNameNorResumeIsGoneWithItsConnection) {
  Session* viewer = join("");
  Session* robot = join("robot");
  ASSERT_TRUE(membership_.services().advertise(robot->index, "robot/odom", {}, 0ms, effects_));
  ASSERT_TRUE(membership_.services().subscribe(viewer->index, "robot/odom", {}, effects_));
  const NodeIndex index = viewer->index;
  const std::vector<std::byte> token = token_of(*viewer);
  effects_.clear();
  lose(*viewer, 1s);
  EXPECT_EQ(count<SessionEnded>(), 1u);
  EXPECT_EQ(count<SubscribersChanged>(), 1u);
  EXPECT_EQ(membership_.sessions().find(index), nullptr);
  JoinRequest again = request("");
  again.token = token;
  const auto joined = membership_.join(again, 2s, effects_);
  ASSERT_TRUE(joined);
  EXPECT_TRUE(joined->new_session);
  EXPECT_EQ(joined->session->index, index) << "its token is good for its id";
}

TEST_F(MembershipTest, ANamelessNodeComesBackToLearnItsNewId) {
  Session* viewer = join("");
  const std::vector<std::byte> token = token_of(*viewer);
  ASSERT_FALSE(membership_.renumber(*viewer, NodeIndex{50}, 1s, effects_));
  membership_.connection_ended(*viewer, {false, GoodbyeCode::renumbered, "50"}, 1s, effects_);
  JoinRequest again = request("");
  again.token = token;
  const auto joined = membership_.join(again, 2s, effects_);
  ASSERT_TRUE(joined);
  EXPECT_EQ(joined->session, viewer);
  EXPECT_EQ(joined->session->index, NodeIndex{50});
}

TEST_F(MembershipTest, AtTheLimitTheOneThatIsAwayLongestMakesWay) {
  Session* provider = join("provider");
  Session* reader = join("reader");
  Session* second = join("second");
  Session* first = join("first");
  ASSERT_TRUE(
      membership_.services().advertise(provider->index, "provider/odom", {}, 0ms, effects_));
  ASSERT_TRUE(membership_.services().subscribe(reader->index, "provider/odom", {}, effects_));
  lose(*provider, 1s);
  lose(*reader, 2s);
  lose(*first, 3s);
  lose(*second, 4s);
  // First those that declared nothing, then the others.
  const char* const newcomers[] = {"a", "b", "c", "d"};
  const char* const gone[] = {"first", "second", "provider", "reader"};
  for (std::size_t i = 0; i < std::size(gone); ++i) {
    effects_.clear();
    ASSERT_TRUE(membership_.directory().find(gone[i]));
    ASSERT_NE(join(newcomers[i], 5s), nullptr);
    EXPECT_EQ(count<SessionEnded>(), 1u);
    EXPECT_FALSE(membership_.directory().find(gone[i])) << gone[i];
  }
  EXPECT_EQ(refused(request("e"), 5s), GoodbyeCode::hub_full);
  EXPECT_EQ(membership_.next_deadline(), 5s + kGrace) << "the group that nobody provides";
}

TEST_F(MembershipTest, ANodeThatCameBackDoesNotMakeWay) {
  Session* viewer = join("viewer");
  for (int i = 0; i < 3; ++i) ASSERT_NE(join(""), nullptr);
  lose(*viewer, 1s);
  const std::vector<std::byte> token = token_of(*viewer);
  JoinRequest again = request("viewer");
  again.token = token;
  ASSERT_TRUE(membership_.join(again, 2s, effects_));
  EXPECT_EQ(refused(request(""), 3s), GoodbyeCode::hub_full);
  EXPECT_TRUE(viewer->connected);
}

TEST_F(MembershipTest, ANodeChangesItsNameAndGivesItBack) {
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

TEST_F(MembershipTest, ANewNameIsJudgedAsAtJoining) {
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

TEST_F(MembershipTest, ANewNameWithdrawsWhatTheNodeProvides) {
  Session* robot = join("robot");
  Session* viewer = join("viewer");
  ASSERT_TRUE(membership_.services().advertise(robot->index, "robot/odom", {}, 0s, effects_));
  ASSERT_TRUE(membership_.services().subscribe(viewer->index, "robot/odom", {}, effects_));
  ASSERT_TRUE(membership_.services().subscribe(robot->index, "viewer/pose", {}, effects_));
  effects_.clear();
  ASSERT_FALSE(membership_.rename(*robot, "forklift", 1s, effects_));
  ASSERT_EQ(count<ServiceChanged>(), 1u);
  EXPECT_EQ(membership_.services().services_of(robot->index), 0u);
  EXPECT_EQ(membership_.topics().provided(), 0u);
  EXPECT_EQ(membership_.topics().by_name().size(), 2u) << "both subscriptions wait on";
}

}  // namespace
}  // namespace gimnet::hub
