#include "hub/control/conductor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/log.hpp"
#include "proto/control/ns.hpp"
#include "tests/hub/control/support/test_conductor.hpp"

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;
using proto::GoodbyeCode;
using ::testing::HasSubstr;
namespace ns = proto::ns;

class ConductorTest : public ::testing::Test, protected TestConductor {
 protected:
  ConductorTest() { set_log_level(LogLevel::off); }
  ~ConductorTest() override { set_log_level(LogLevel::info); }
};

TEST_F(ConductorTest, WelcomesWithWhatTheNodeNeedsToKnow) {
  const Node robot = join("robot");
  EXPECT_EQ(robot.welcome.node, make_id<NodeId>(kHub, 1));
  EXPECT_EQ(robot.welcome.hub, kHub);
  EXPECT_EQ(robot.welcome.hub_name, "hub-7");
  EXPECT_EQ(robot.welcome.name, "robot");
  EXPECT_EQ(robot.welcome.hub_time_ns, 1'000'000'000);
  EXPECT_EQ(robot.welcome.keep_alive_ms, limits.keep_alive_ms);
  EXPECT_EQ(robot.welcome.grace_ms, limits.grace_ms);
  EXPECT_EQ(robot.welcome.retained_bytes_max, limits.retained_message_bytes);
  EXPECT_EQ(robot.welcome.last_goodbye_code, 0);
  EXPECT_FALSE(robot.welcome.token.empty());
}

TEST_F(ConductorTest, PassesOnWhatHelloSaidOfResume) {
  proto::Hello hello;
  hello.resume = true;
  hello.epoch = 11;
  hello.resume_epoch = 12;
  hello.resume_taken = 13;
  hello.resume_buffer_bytes = 14;
  hello.frame_length_max = 70'000;
  join(hello);
  const AttachCommand& attach = *shards.all<AttachCommand>()[0];
  EXPECT_TRUE(attach.new_session);
  EXPECT_TRUE(attach.resume_wanted);
  EXPECT_EQ(attach.peer_epoch, 11u);
  EXPECT_EQ(attach.known_hub_epoch, 12u);
  EXPECT_EQ(attach.known_taken, 13u);
  EXPECT_EQ(attach.peer_resume_bytes, 14u);
  EXPECT_EQ(attach.peer_frame_bytes, 70'000u);
  EXPECT_NE(attach.transport, nullptr);
}

TEST_F(ConductorTest, PublishesANodeBeforeItsWelcomeCanLeave) {
  bool published_at_attach = false;
  shards.on_send = [&](const ShardCommand& command) {
    if (std::holds_alternative<AttachCommand>(command))
      published_at_attach = nodes.find(1).exists();
  };
  const Node robot = join("robot");
  EXPECT_TRUE(published_at_attach);
  EXPECT_EQ(nodes.find(1), (NodePlace{robot.shard, robot.session.slot, robot.session.generation}));
}

TEST_F(ConductorTest, UnpublishesBeforeItReleases) {
  const Node robot = join("robot");
  bool published_at_release = true;
  shards.on_send = [&](const ShardCommand& command) {
    if (std::holds_alternative<ReleaseCommand>(command))
      published_at_release = nodes.find(1).exists();
  };
  detach(robot, true, GoodbyeCode::done);
  ASSERT_EQ(shards.all<ReleaseCommand>().size(), 1u);
  EXPECT_EQ(shards.all<ReleaseCommand>()[0]->session.generation, robot.session.generation);
  EXPECT_FALSE(published_at_release);
}

TEST_F(ConductorTest, ReleasesANamelessNodeThatWasClosedForWhatItSent) {
  const Node viewer = join("");
  detach(viewer, false, GoodbyeCode::malformed, "a bad frame");
  ASSERT_EQ(shards.all<ReleaseCommand>().size(), 1u);
  EXPECT_EQ(shards.all<ReleaseCommand>()[0]->session.generation, viewer.session.generation);
  EXPECT_FALSE(nodes.find(1).exists());
  EXPECT_EQ(conductor.next_deadline(), std::nullopt);
}

TEST_F(ConductorTest, KeepsANodeThatLostItsConnectionForTheGraceTime) {
  const Node robot = join("robot");
  detach(robot);
  EXPECT_TRUE(nodes.find(1).exists());
  EXPECT_EQ(conductor.next_deadline(), 31s);
  now = 31s;
  conductor.tick(now);
  EXPECT_FALSE(nodes.find(1).exists());
  EXPECT_EQ(shards.all<ReleaseCommand>().size(), 1u);
}

TEST_F(ConductorTest, AReturningNodeKeepsItsPlaceAndHearsHowItWasClosed) {
  const Node robot = join("robot");
  detach(robot, false, GoodbyeCode::silent, "nothing heard");
  proto::Hello hello;
  hello.token = robot.welcome.token;
  const Node back = join(hello);
  EXPECT_EQ(back.id, robot.id);
  EXPECT_EQ(back.session.slot, robot.session.slot);
  EXPECT_EQ(back.session.generation, robot.session.generation);
  EXPECT_EQ(back.attachment, 2u);
  EXPECT_EQ(back.welcome.last_goodbye_code, static_cast<std::uint16_t>(GoodbyeCode::silent));
  EXPECT_EQ(back.welcome.last_goodbye_sentence, "nothing heard");
  EXPECT_FALSE(shards.all<AttachCommand>()[1]->new_session);
  detach(back);
  EXPECT_EQ(join(hello).welcome.last_goodbye_code, 0);
}

TEST_F(ConductorTest, TheEndOfAReplacedConnectionIsNotTheEndOfTheNewOne) {
  const Node robot = join("robot");
  proto::Hello hello;
  hello.token = robot.welcome.token;
  const Node newer = join(hello);
  detach(robot);
  EXPECT_TRUE(conductor.membership().sessions().find(NodeIndex{1})->connected);
  detach(newer);
  EXPECT_FALSE(conductor.membership().sessions().find(NodeIndex{1})->connected);
}

TEST_F(ConductorTest, RequestsOfAReplacedConnectionChangeNothing) {
  const Node robot = join("robot");
  proto::Hello hello;
  hello.token = robot.welcome.token;
  join(hello);
  const std::size_t sent = shards.sent.size();
  send_frame(robot, proto::Kind::ns, proto::encode(ns::Subscribe{"camera/image"}, 1));
  EXPECT_EQ(shards.sent.size(), sent);
  EXPECT_EQ(conductor.membership().topics().by_name().size(), 0u);
}

TEST_F(ConductorTest, EventsOfAnEarlierSessionAreIgnored) {
  const Node robot = join("robot");
  detach(robot, true, GoodbyeCode::done);
  const std::size_t sent = shards.sent.size();
  detach(robot);
  send_frame(robot, proto::Kind::ns, proto::encode(ns::Resolve{"robot"}, 1));
  EXPECT_EQ(shards.sent.size(), sent);
}

TEST_F(ConductorTest, AnswersARequestForAnotherHub) {
  const Node robot = join("robot");
  const auto status = [&](NodeId dst) {
    shards.sent.clear();
    send_frame(robot, proto::Kind::ns, proto::encode(ns::Resolve{"robot"}, 5), dst);
    EXPECT_EQ(shards.sent.size(), 1u);
    const auto* answer = std::get_if<SendControlCommand>(&shards.sent.back().command);
    EXPECT_EQ(answer->answers, 1u);
    const auto read = proto::decode_answer<ns::ResolveAnswer>(payload_of(*answer));
    return read ? proto::Status::done : read.error().status;
  };
  EXPECT_EQ(status(NodeId{}), proto::Status::done);
  EXPECT_EQ(status(make_id<NodeId>(HubId{7}, 0)), proto::Status::done) << "this hub by its id";
  EXPECT_EQ(status(make_id<NodeId>(HubId{8}, 0)), proto::Status::not_found);
  EXPECT_EQ(status(robot.id), proto::Status::not_found) << "a node is no hub";
  EXPECT_TRUE(conductor.membership().sessions().find(NodeIndex{1})->connected);
}

TEST_F(ConductorTest, RefusesWithAReason) {
  join("robot");
  proto::Hello hello;
  hello.name = "robot";
  const auto refusal = try_join(hello);
  ASSERT_TRUE(refusal);
  EXPECT_EQ(refusal->code, GoodbyeCode::name_taken);
  EXPECT_THAT(refusal->sentence, HasSubstr("7.1"));
}

TEST_F(ConductorTest, ASubscriberIsPublishedBeforeItsAnswerLeaves) {
  const Node robot = join("robot");
  const Node viewer = join("viewer");
  const auto group = ask<ns::AdvertiseAnswer>(robot, ns::Advertise{.service = "odom"});
  ASSERT_TRUE(group);
  bool published_at_answer = false;
  shards.on_send = [&](const ShardCommand& command) {
    const auto* answer = std::get_if<SendControlCommand>(&command);
    if (answer == nullptr || answer->answers != 1) return;
    const GroupMembers* members = groups.find(index_of(group->group));
    published_at_answer = members != nullptr && members->by_shard[viewer.shard.value()].size() == 1;
  };
  const auto subscribed = ask<ns::SubscribeAnswer>(viewer, ns::Subscribe{"robot/odom"});
  ASSERT_TRUE(subscribed);
  EXPECT_EQ(subscribed->group, group->group);
  EXPECT_TRUE(published_at_answer);
  const auto told = events<ns::Subscribers>();
  ASSERT_EQ(told.size(), 1u);
  EXPECT_EQ(told[0], (ns::Subscribers{group->group, 1}));
}

TEST_F(ConductorTest, SubscribersHearOfANewGroupBeforeItsProviderMaySend) {
  const Node robot = join("robot");
  const Node viewer = join("viewer");
  ASSERT_TRUE(ask<ns::SubscribeAnswer>(viewer, ns::Subscribe{"robot/odom"}));
  shards.sent.clear();
  const auto group =
      ask<ns::AdvertiseAnswer>(robot, ns::Advertise{.service = "odom", .message_type = 5});
  ASSERT_TRUE(group);
  EXPECT_EQ(group->subscribers, 1u);
  ASSERT_EQ(shards.sent.size(), 2u);  // the event, then the answer
  const auto moved = events<ns::ServiceMoved>();
  ASSERT_EQ(moved.size(), 1u);
  EXPECT_EQ(moved[0].name, "robot/odom");
  EXPECT_EQ(moved[0].group, group->group);
  EXPECT_EQ(moved[0].provider, robot.id);
  EXPECT_NE(moved[0].session, 0u);
  EXPECT_EQ(moved[0].message_type, 5u);
  EXPECT_EQ(std::get<SendControlCommand>(shards.sent[0].command).session.generation,
            viewer.session.generation);
}

TEST_F(ConductorTest, WhoIsAwayIsSentNoEvents) {
  const Node robot = join("robot");
  const Node viewer = join("viewer");
  ASSERT_TRUE(ask<ns::SubscribeAnswer>(viewer, ns::Subscribe{"robot/odom"}));
  detach(viewer);
  ASSERT_TRUE(ask<ns::AdvertiseAnswer>(robot, ns::Advertise{.service = "odom"}));
  EXPECT_TRUE(events<ns::ServiceMoved>().empty());
}

TEST_F(ConductorTest, AControlFrameWithoutAHeaderIsMalformed) {
  const Node robot = join("robot");
  send_frame(robot, proto::Kind::ns, std::vector<std::byte>(3));
  ASSERT_EQ(shards.all<CloseCommand>().size(), 1u);
  EXPECT_EQ(shards.all<CloseCommand>()[0]->code, GoodbyeCode::malformed);
}

TEST_F(ConductorTest, NodesSendNoFramesBetweenHubs) {
  const Node robot = join("robot");
  send_frame(robot, proto::Kind::route, std::vector<std::byte>(4));
  ASSERT_EQ(shards.all<CloseCommand>().size(), 1u);
  EXPECT_EQ(shards.all<CloseCommand>()[0]->code, GoodbyeCode::not_allowed);
}

TEST_F(ConductorTest, DrainsEveryShardAndAdmitsNobodyMeanwhile) {
  join("robot");
  conductor.drain();
  ASSERT_EQ(shards.all<DrainCommand>().size(), 2u);
  EXPECT_EQ(shards.all<DrainCommand>()[0]->deadline_ms, limits.drain_ms);
  EXPECT_EQ(try_join(proto::Hello{})->code, GoodbyeCode::draining);
  conductor.on_event({ShardIndex{0}, DrainedEvent{}}, now);
  EXPECT_FALSE(conductor.drained());
  conductor.on_event({ShardIndex{1}, DrainedEvent{}}, now);
  EXPECT_TRUE(conductor.drained());
}

TEST_F(ConductorTest, ThousandsComeAndGoAndNothingStays) {
  limits.grace_ms = 0;
  for (int i = 0; i < 5'000; ++i) {
    const Node node = join("node-" + std::to_string(i));
    ASSERT_TRUE(ask<ns::AdvertiseAnswer>(node, ns::Advertise{.service = "s"}));
    ASSERT_TRUE(
        ask<ns::SubscribeAnswer>(node, ns::Subscribe{"node-" + std::to_string(i + 1) + "/s"}));
    detach(node, i % 2 == 0, GoodbyeCode::done);
    now += 1ms;
    conductor.tick(now);
    shards.sent.clear();
  }
  EXPECT_TRUE(conductor.membership().sessions().all().empty());
  EXPECT_EQ(conductor.membership().directory().size(), 0u);
  EXPECT_EQ(conductor.membership().topics().by_name().size(), 0u);
  EXPECT_FALSE(conductor.has_garbage());
}

class RestartedConductorTest : public ::testing::Test, protected TestConductor {
 protected:
  RestartedConductorTest()
      : TestConductor(Placement::spread, {{}, {1, IndexPool::kBlock}, {1, IndexPool::kBlock}}) {
    set_log_level(LogLevel::off);
  }
  ~RestartedConductorTest() override { set_log_level(LogLevel::info); }
  void join_half_a_block() {
    for (std::uint32_t i = 0; i < IndexPool::kBlock / 2; ++i) join("");
  }
};

TEST_F(RestartedConductorTest, KeepsTheMarkBeforeAnIdOfTheNextBlockIsUsed) {
  join_half_a_block();
  EXPECT_TRUE(kept.empty());
  std::size_t kept_at_attach = 0;
  shards.on_send = [&](const ShardCommand&) { kept_at_attach = kept.size(); };
  join("");
  ASSERT_EQ(kept.size(), 1u);
  EXPECT_EQ(kept_at_attach, 1u);
  EXPECT_EQ(kept[0].node_mark, 1 + 2 * IndexPool::kBlock);
}

TEST_F(RestartedConductorTest, GoesOnWithinItsBlockWhileStateCannotBeKeptAndTriesAgain) {
  keep_error = "no space";
  join_half_a_block();
  join("");
  EXPECT_EQ(kept.size(), 1u);
  join("");
  EXPECT_EQ(kept.size(), 1u) << "not again at once";
  EXPECT_EQ(conductor.next_deadline(), now + 1s);
  now += 1s;
  keep_error.clear();
  conductor.tick(now);
  EXPECT_EQ(kept.size(), 2u);
  EXPECT_EQ(conductor.next_deadline(), std::nullopt);
  for (std::uint32_t i = 0; i < IndexPool::kBlock / 2; ++i) join("");
  EXPECT_EQ(kept.size(), 2u);
}

class SecondStartTest : public ::testing::Test, protected TestConductor {
 protected:
  SecondStartTest() : TestConductor(Placement::spread, second_start()) {
    set_log_level(LogLevel::off);
  }
  ~SecondStartTest() override { set_log_level(LogLevel::info); }
  static HubStart second_start() {
    HubStart start{{}, {4'097, IndexPool::kBlock}, {4'097, IndexPool::kBlock}};
    start.state.boot = 2;
    for (const std::uint32_t index : {1u, 4'096u, 900'000u}) start.nodes.used.insert(index);
    return start;
  }
};

TEST_F(SecondStartTest, NodesThatAreNotBackAreAwayForAGraceTime) {
  const std::chrono::milliseconds end =
      facts().started + std::chrono::milliseconds{limits.grace_ms};
  EXPECT_TRUE(nodes.may_return(4'096) && nodes.may_return(900'000))
      << "wherever REASSIGN had put them";
  EXPECT_FALSE(nodes.may_return(4'000)) << "nobody had it";
  EXPECT_EQ(index_of(join("Z").id), 4'097u);
  EXPECT_EQ(conductor.next_deadline(), end);
  conductor.tick(end - 1ms);
  EXPECT_TRUE(nodes.may_return(4'096));
  conductor.tick(end);
  for (const std::uint32_t index : {4'096u, 900'000u})
    EXPECT_FALSE(nodes.may_return(index)) << index;
  EXPECT_EQ(conductor.next_deadline(), std::nullopt);
}

TEST_F(ConductorTest, ATokenIsForItsIdentityOnly) {
  const Node robot = join("robot");
  detach(robot);
  proto::Hello hello;
  hello.name = "robot";
  hello.token = robot.welcome.token;
  identity = Identity::of_user(7);
  EXPECT_NE(join(hello).id, robot.id);
}

TEST_F(ConductorTest, ClosesWhoAsksTooOftenForWhatIsOfNoUse) {
  limits.oddities_burst = 3;
  limits.oddities_per_s = 10;
  const Node robot = join("robot");
  const auto ask_odd = [&] {
    EXPECT_EQ(ask<ns::ListAnswer>(robot, ns::List{.pattern = "**/"}).error().status,
              proto::Status::bad_request);
  };
  const auto nobody = [&] {
    EXPECT_EQ(ask<ns::ResolveAnswer>(robot, ns::Resolve{"nobody"}).error().status,
              proto::Status::not_found);
  };
  for (int i = 0; i < 3; ++i) ask_odd();
  for (int i = 0; i < 100; ++i) nobody();
  now += 100ms;
  ask_odd();
  EXPECT_TRUE(shards.all<CloseCommand>().empty()) << "the limit, and one for the time that passed";
  send_frame(robot, proto::Kind::ns, proto::encode_refusal({999, 7}, {}));
  ASSERT_EQ(shards.all<CloseCommand>().size(), 1u);
  EXPECT_EQ(shards.all<CloseCommand>()[0]->code, GoodbyeCode::oddities);
  EXPECT_THAT(shards.all<CloseCommand>()[0]->sentence, HasSubstr("more than 3 requests"));
  // A new connection is no way to get more.
  detach(robot, false, GoodbyeCode::oddities, "too odd");
  proto::Hello hello;
  hello.token = robot.welcome.token;
  const Node back = join(hello);
  EXPECT_EQ(back.welcome.last_goodbye_code, static_cast<std::uint16_t>(GoodbyeCode::oddities));
  send_frame(back, proto::Kind::ns, proto::encode_refusal({999, 7}, {}));
  EXPECT_EQ(shards.all<CloseCommand>().size(), 2u);
}

TEST_F(ConductorTest, TheDefaultsLetAThousandOdditiesPassAndNotOneMore) {
  const Node robot = join("robot");
  for (int i = 0; i < 1'000; ++i)
    send_frame(robot, proto::Kind::ctrl, proto::encode_refusal({999, 7}, {}));
  EXPECT_TRUE(shards.all<CloseCommand>().empty());
  send_frame(robot, proto::Kind::ctrl, proto::encode_refusal({999, 7}, {}));
  EXPECT_EQ(shards.all<CloseCommand>().size(), 1u);
}

}  // namespace
}  // namespace gimnet::hub
