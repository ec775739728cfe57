#include "hub/control/handle/administer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <tuple>
#include <vector>

#include "base/ids.hpp"
#include "base/log.hpp"
#include "proto/control/ctrl.hpp"
#include "proto/control/ns.hpp"
#include "proto/control/ns_watch.hpp"
#include "tests/hub/control/support/test_conductor.hpp"

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;
using proto::Status;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;
namespace ctrl = proto::ctrl;
namespace ns = proto::ns;

class AdministerTest : public ::testing::Test, protected TestConductor {
 protected:
  explicit AdministerTest(const HubStart& start = {}) : TestConductor(Placement::spread, start) {
    set_log_level(LogLevel::off);
  }
  ~AdministerTest() override { set_log_level(LogLevel::info); }

  Node join_admin() {
    may_administer = true;
    proto::Hello hello;
    hello.role = proto::Role::admin;
    const Node admin = join(hello);
    may_administer = false;
    return admin;
  }
  template <class Message>
  auto request(const Node& node, const Message& message) {
    using Answer = typename AnswerTo<Message>::type;
    return ask<Answer>(node, message, proto::Kind::ctrl);
  }
  template <class Message>
  proto::Refusal refused(const Node& node, const Message& message) {
    const auto answer = request(node, message);
    EXPECT_FALSE(answer);
    return answer ? proto::Refusal{} : answer.error();
  }
  /// Comes back with the token of its WELCOME.
  Node rejoin(const Node& node, const std::string& name) {
    proto::Hello hello;
    hello.name = name;
    hello.token = node.welcome.token;
    return join(hello);
  }

  template <class Message>
  struct AnswerTo;

  const Node admin_ = join_admin();
  const Node robot_ = join("robot");
};
template <>
struct AdministerTest::AnswerTo<ctrl::Kick> {
  using type = ctrl::KickAnswer;
};
template <>
struct AdministerTest::AnswerTo<ctrl::Reassign> {
  using type = ctrl::ReassignAnswer;
};
template <>
struct AdministerTest::AnswerTo<ctrl::Drain> {
  using type = ctrl::DrainAnswer;
};
template <>
struct AdministerTest::AnswerTo<ctrl::Reload> {
  using type = ctrl::ReloadAnswer;
};
template <>
struct AdministerTest::AnswerTo<ctrl::SetLogLevel> {
  using type = ctrl::SetLogLevelAnswer;
};

TEST_F(AdministerTest, WhoIsNoAdministratorIsDeniedWithWords) {
  for (const proto::Refusal& refusal :
       {refused(robot_, ctrl::Kick{admin_.id, ""}),
        refused(robot_, ctrl::Reassign{admin_.id, robot_.id}), refused(robot_, ctrl::Drain{}),
        refused(robot_, ctrl::Reload{}), refused(robot_, ctrl::SetLogLevel{"off"})}) {
    EXPECT_EQ(refusal.status, Status::denied);
    EXPECT_THAT(refusal.sentence, HasSubstr("Unix socket"));
  }
  EXPECT_EQ(conductor.membership().sessions().all().size(), 2u);
  EXPECT_FALSE(conductor.drain_wanted());
}

TEST_F(AdministerTest, KicksWithTheReasonAndForGood) {
  ASSERT_TRUE(request(admin_, ctrl::Kick{robot_.id, "it stands in the way"}));
  ASSERT_THAT(shards.all<CloseCommand>(), SizeIs(1));
  const CloseCommand& close = *shards.all<CloseCommand>()[0];
  EXPECT_EQ(close.session.generation, robot_.session.generation);
  EXPECT_EQ(close.code, proto::GoodbyeCode::kicked);
  EXPECT_THAT(close.sentence, HasSubstr("it stands in the way"));
  EXPECT_THAT(shards.all<ReleaseCommand>(), SizeIs(1));
  EXPECT_FALSE(nodes.find(index_of(robot_.id)).exists());
  const Node again = rejoin(robot_, "robot");
  EXPECT_NE(again.id, robot_.id);
}

TEST_F(AdministerTest, ClosesBeforeItReleases) {
  std::vector<std::size_t> order;
  shards.on_send = [&](const ShardCommand& command) { order.push_back(command.index()); };
  ASSERT_TRUE(request(admin_, ctrl::Kick{robot_.id, ""}));
  const std::vector<std::size_t> wanted{ShardCommand{CloseCommand{}}.index(),
                                        ShardCommand{ReleaseCommand{}}.index(),
                                        ShardCommand{SendControlCommand{}}.index()};
  EXPECT_EQ(order, wanted);
}

TEST_F(AdministerTest, KicksWhoIsAway) {
  detach(robot_);
  ASSERT_TRUE(request(admin_, ctrl::Kick{robot_.id, ""}));
  EXPECT_EQ(conductor.membership().sessions().all().size(), 1u);
}

TEST_F(AdministerTest, KicksNobodyWhoIsNotThereNorItself) {
  EXPECT_EQ(refused(admin_, ctrl::Kick{make_id<NodeId>(kHub, 99), ""}).status, Status::not_found);
  EXPECT_EQ(refused(admin_, ctrl::Kick{make_id<NodeId>(HubId{8}, 1), ""}).status,
            Status::not_found);
  EXPECT_EQ(refused(admin_, ctrl::Kick{admin_.id, ""}).status, Status::bad_request);
}

TEST_F(AdministerTest, ANodeGoesOnUnderAnotherId) {
  const NodeId wanted = make_id<NodeId>(kHub, 77);
  ASSERT_TRUE(request(admin_, ctrl::Reassign{robot_.id, wanted}));
  ASSERT_THAT(shards.all<RenumberCommand>(), SizeIs(1));
  EXPECT_EQ(shards.all<RenumberCommand>()[0]->node, wanted);
  EXPECT_EQ(nodes.find(77),
            (NodePlace{robot_.shard, robot_.session.slot, robot_.session.generation}));
  EXPECT_TRUE(nodes.find(index_of(robot_.id)).is_renumbered());
  // Its shard closed the connection, and said so under the id that it knew then.
  detach(robot_, false, proto::GoodbyeCode::renumbered);
  EXPECT_FALSE(conductor.membership().sessions().find(NodeIndex{77})->connected);
  const Node again = rejoin(robot_, "robot");
  EXPECT_EQ(again.id, wanted);
  EXPECT_EQ(again.welcome.name, "robot");
  EXPECT_EQ(again.session.generation, robot_.session.generation);
  const auto resolved = ask<ns::ResolveAnswer>(admin_, ns::Resolve{"robot"});
  EXPECT_EQ(resolved->node, wanted);
}

TEST_F(AdministerTest, WhoWatchesIsToldOfTheFormerIdAndOfTheNewOne) {
  const Node viewer = join("viewer");
  ASSERT_TRUE(ask<ns::AdvertiseAnswer>(robot_, ns::Advertise{.service = "odom"}));
  ASSERT_TRUE(ask<ns::WatchAnswer>(viewer, ns::Watch{.watch = 1, .pattern = "robot/**"}));
  while (conductor.tell_rest(now)) {
  }
  const std::size_t before = events<ns::WatchEvents>().size();
  const NodeId wanted = make_id<NodeId>(kHub, 77);
  ASSERT_TRUE(request(admin_, ctrl::Reassign{robot_.id, wanted}));
  while (conductor.tell_rest(now)) {
  }
  const auto told = events<ns::WatchEvents>();
  ASSERT_EQ(told.size(), before + 1);
  const std::vector<ns::Change>& changes = told.back().changes;
  ASSERT_THAT(changes, SizeIs(3));
  EXPECT_EQ(changes[0].kind, ns::ChangeKind::left);
  EXPECT_EQ(changes[0].node->node, robot_.id);
  EXPECT_EQ(changes[0].node->name, "robot");
  EXPECT_EQ(changes[1].kind, ns::ChangeKind::joined);
  EXPECT_EQ(changes[1].node->node, wanted);
  EXPECT_EQ(changes[1].node->name, "robot");
  EXPECT_EQ(changes[2].kind, ns::ChangeKind::changed);
  EXPECT_EQ(changes[2].service->node, wanted);
}

TEST_F(AdministerTest, WhoIsKickedWatchesNothingAnyMore) {
  ASSERT_TRUE(ask<ns::WatchAnswer>(robot_, ns::Watch{.watch = 1}));
  EXPECT_EQ(conductor.watches().size(), 1u);
  ASSERT_TRUE(request(admin_, ctrl::Kick{robot_.id, ""}));
  EXPECT_EQ(conductor.watches().size(), 0u);
}

TEST_F(AdministerTest, OnlyAFreeIdOfThisHubCanBeGiven) {
  EXPECT_EQ(refused(admin_, ctrl::Reassign{robot_.id, admin_.id}).status, Status::taken);
  const auto own = refused(admin_, ctrl::Reassign{robot_.id, robot_.id});
  EXPECT_EQ(own.status, Status::taken);
  EXPECT_EQ(own.sentence,
            "this node has the id " + to_string(robot_.id) + " already; choose a free one");
  EXPECT_EQ(refused(admin_, ctrl::Reassign{robot_.id, make_id<NodeId>(HubId{8}, 5)}).status,
            Status::bad_request);
  EXPECT_EQ(refused(admin_, ctrl::Reassign{robot_.id, make_id<NodeId>(kHub, 0)}).status,
            Status::bad_request);
  EXPECT_EQ(refused(admin_, ctrl::Reassign{robot_.id, make_id<NodeId>(kHub, kEveryIndex)}).status,
            Status::bad_request);
  EXPECT_EQ(refused(admin_, ctrl::Reassign{admin_.id, make_id<NodeId>(kHub, 9)}).status,
            Status::bad_request);
  EXPECT_EQ(
      refused(admin_, ctrl::Reassign{make_id<NodeId>(kHub, 50), make_id<NodeId>(kHub, 51)}).status,
      Status::not_found);
  ASSERT_TRUE(request(admin_, ctrl::Reassign{robot_.id, make_id<NodeId>(kHub, kEveryIndex - 1)}));
  // The former id rests; a node can be named by it all the same.
  const Node other = join("other");
  EXPECT_EQ(refused(admin_, ctrl::Reassign{other.id, robot_.id}).status, Status::taken);
  // Another id is for a node that did not come back for the one that it has.
  ASSERT_TRUE(request(admin_, ctrl::Reassign{robot_.id, make_id<NodeId>(kHub, 500)}));
  detach(robot_, false, proto::GoodbyeCode::renumbered);
  EXPECT_EQ(rejoin(robot_, "robot").id, make_id<NodeId>(kHub, 500));
  EXPECT_TRUE(nodes.find(500).exists());
}

class RestartedAdministerTest : public AdministerTest {
 protected:
  RestartedAdministerTest() : AdministerTest(second_start()) {}
  static HubStart second_start() {
    HubStart start{{}, {4'097, IndexPool::kBlock}, {4'097, IndexPool::kBlock}};
    for (std::uint32_t index = 1; index <= 4'096; ++index) start.nodes.used.insert(index);
    start.state.boot = 2;
    return start;
  }
};

TEST_F(RestartedAdministerTest, AnIdThatANodeMayComeBackUnderIsTakenForAGraceTime) {
  const NodeId of_before = make_id<NodeId>(kHub, 1);
  now = facts().started + std::chrono::milliseconds{limits.grace_ms} - 1ms;
  const proto::Refusal refusal = refused(admin_, ctrl::Reassign{robot_.id, of_before});
  EXPECT_EQ(refusal.status, Status::taken);
  EXPECT_THAT(refusal.sentence, HasSubstr("its node has not come back yet"));
  EXPECT_EQ(index_of(robot_.id), 4'098u) << "and nothing else was changed";
  EXPECT_TRUE(nodes.find(4'098).exists());
  now += 1ms;
  ASSERT_TRUE(request(admin_, ctrl::Reassign{robot_.id, of_before}));
  EXPECT_TRUE(nodes.find(1).exists());
}

// Whose WELCOME is lost knows its former id only, and comes back with that one's token.
TEST_F(AdministerTest, AWelcomeThatWasLostToldNobodyOfAnId) {
  const NodeId second = make_id<NodeId>(kHub, 500);
  const NodeId third = make_id<NodeId>(kHub, 501);
  ASSERT_TRUE(request(admin_, ctrl::Reassign{robot_.id, second}));
  detach(robot_, false, proto::GoodbyeCode::renumbered);
  const Node deaf = rejoin(robot_, "robot");
  EXPECT_EQ(deaf.id, second);
  detach(deaf);
  const Node again = rejoin(robot_, "robot");
  EXPECT_EQ(again.id, second) << "by the token of the first id";
  ASSERT_TRUE(request(admin_, ctrl::Reassign{second, third}));
  EXPECT_EQ(rejoin(again, "robot").id, third);
  EXPECT_EQ(rejoin(robot_, "robot").id, third) << "each of its tokens leads to it";
}

TEST_F(AdministerTest, ServicesAndSubscriptionsFollowTheId) {
  const Node viewer = join("viewer");
  const auto odom = ask<ns::AdvertiseAnswer>(robot_, ns::Advertise{.service = "odom"});
  ASSERT_TRUE(ask<ns::SubscribeAnswer>(viewer, ns::Subscribe{.name = "robot/odom"}));
  ASSERT_TRUE(request(admin_, ctrl::Reassign{robot_.id, make_id<NodeId>(kHub, 70)}));
  ASSERT_TRUE(request(admin_, ctrl::Reassign{viewer.id, make_id<NodeId>(kHub, 60)}));
  const GroupMembers* members = groups.find(index_of(odom->group));
  ASSERT_NE(members, nullptr);
  EXPECT_EQ(members->provider, make_id<NodeId>(kHub, 70));
  ASSERT_THAT(members->by_shard[viewer.shard.value()], SizeIs(1));
  const GroupMember* member = members->by_shard[viewer.shard.value()].find(viewer.session.slot);
  ASSERT_NE(member, nullptr);
  EXPECT_EQ(member->generation, viewer.session.generation);
  const auto moved = events<ns::ServiceMoved>();
  ASSERT_FALSE(moved.empty());
  EXPECT_EQ(moved.back().provider, make_id<NodeId>(kHub, 70));
  EXPECT_EQ(moved.back().group, odom->group);
}

TEST_F(AdministerTest, AnIdThatIsHandedOutAgainLeadsToItsNewNode) {
  ASSERT_TRUE(request(admin_, ctrl::Reassign{robot_.id, make_id<NodeId>(kHub, 70)}));
  detach(robot_, true, proto::GoodbyeCode::done);
  EXPECT_FALSE(nodes.find(index_of(robot_.id)).exists());
  EXPECT_FALSE(nodes.find(index_of(robot_.id)).is_renumbered());
}

TEST_F(AdministerTest, WhoIsAwayAndRenumberedIsEndedAfterItsGraceTime) {
  detach(robot_);
  ASSERT_TRUE(request(admin_, ctrl::Reassign{robot_.id, make_id<NodeId>(kHub, 70)}));
  now += std::chrono::milliseconds{limits.grace_ms};
  conductor.tick(now);
  EXPECT_EQ(conductor.membership().sessions().find(NodeIndex{70}), nullptr);
  EXPECT_FALSE(nodes.find(index_of(robot_.id)).is_renumbered());
}

TEST_F(AdministerTest, DrainIsWantedOnceTheAnswerIsOnItsWay) {
  ASSERT_TRUE(request(admin_, ctrl::Drain{}));
  EXPECT_TRUE(conductor.drain_wanted());
}

TEST_F(AdministerTest, ReloadSwapsLimitsHereAndOnEveryShard) {
  read_again = [] {
    Reloading reloading;
    reloading.limits.page_records = 7;
    reloading.log_level = LogLevel::off;
    reloading.changes = {{"limits.page_records", "256", "7", false}, {"shards", "2", "3", true}};
    return reloading;
  };
  const auto answer = request(admin_, ctrl::Reload{});
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->changes,
            (std::vector<ctrl::ChangeRecord>{{"limits.page_records", "256", "7", false},
                                             {"shards", "2", "3", true}}));
  EXPECT_EQ(limits.page_records, 7u);
  ASSERT_THAT(shards.all<LimitsCommand>(), SizeIs(2));
  EXPECT_EQ(shards.all<LimitsCommand>()[1]->limits.page_records, 7u);
  EXPECT_EQ(log_level(), LogLevel::off);
}

TEST_F(AdministerTest, ABadConfigurationChangesNothing) {
  read_again = [] {
    Reloading reloading;
    reloading.limits.page_records = 7;
    reloading.faults = {"hub.toml:3:10: shards cannot be '99'"};
    return reloading;
  };
  const proto::Refusal refusal = refused(admin_, ctrl::Reload{});
  EXPECT_EQ(refusal.status, Status::bad_request);
  EXPECT_THAT(refusal.sentence, HasSubstr("stays in force"));
  EXPECT_THAT(refusal.sentence, HasSubstr("hub.toml:3:10"));
  EXPECT_EQ(limits.page_records, Limits{}.page_records);
  EXPECT_THAT(shards.all<LimitsCommand>(), SizeIs(0));
}

TEST_F(AdministerTest, OfAConfigurationWithManyFaultsWholeOnesAreTold) {
  read_again = [] {
    Reloading reloading;
    reloading.faults.assign(
        100, "hub.toml:3:10: shards cannot be '99': give a whole number from 1 to 16");
    reloading.more_faults = true;
    return reloading;
  };
  const std::string said = refused(admin_, ctrl::Reload{}).sentence;
  EXPECT_THAT(said,
              ::testing::MatchesRegex(
                  ".* stays in force(\nhub.toml:3:10: shards cannot be '99': give a whole number "
                  "from 1 to 16)+"
                  "\nand at least [0-9]+ more faults: tcphub --check-config tells all of them"));
}

TEST_F(AdministerTest, SetsTheLogLevelAndTellsTheOneBefore) {
  EXPECT_EQ(request(admin_, ctrl::SetLogLevel{"error"})->before, "off");
  EXPECT_EQ(log_level(), LogLevel::error);
  EXPECT_EQ(noted_level, LogLevel::error);
  EXPECT_THAT(refused(admin_, ctrl::SetLogLevel{"eror"}).sentence,
              HasSubstr("did you mean error?"));
  EXPECT_EQ(log_level(), LogLevel::error);
}

}  // namespace
}  // namespace gimnet::hub
