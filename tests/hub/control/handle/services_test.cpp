#include "hub/control/handle/services.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "base/log.hpp"
#include "proto/control/ns.hpp"
#include "tests/hub/control/support/test_conductor.hpp"

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;
using proto::Status;
namespace ns = proto::ns;

class ServiceRequestsTest : public ::testing::Test, protected TestConductor {
 protected:
  ServiceRequestsTest() { set_log_level(LogLevel::off); }
  ~ServiceRequestsTest() override { set_log_level(LogLevel::info); }
};

TEST_F(ServiceRequestsTest, AServiceIsNamedAfterItsNode) {
  const Node robot = join("hall/robot");
  const auto advertised = ask<ns::AdvertiseAnswer>(
      robot,
      ns::Advertise{
          .service = "odom", .message_type = 5, .instance = 6, .delivery = ns::Delivery::latest});
  ASSERT_TRUE(advertised);
  EXPECT_EQ(hub_of(advertised->group), kHub);
  const auto answer = ask<ns::ServicesAnswer>(robot, ns::ServicesRequest{});
  ASSERT_TRUE(answer);
  ASSERT_EQ(answer->services.size(), 1u);
  ns::ServiceRecord expected;
  expected.group = advertised->group;
  expected.name = "hall/robot/odom";
  expected.node = robot.id;
  expected.message_type = 5;
  expected.instance = 6;
  expected.delivery = ns::Delivery::latest;
  expected.hub_name = "hub-7";
  EXPECT_EQ(answer->services[0], expected);
}

TEST_F(ServiceRequestsTest, ANodeWithoutANameCannotAdvertise) {
  const Node nobody = join("");
  EXPECT_EQ(ask<ns::AdvertiseAnswer>(nobody, ns::Advertise{.service = "odom"}).error().status,
            Status::bad_request);
}

TEST_F(ServiceRequestsTest, SyncAndRetainAreShownAndKeptToTheirLimits) {
  const Node robot = join("robot");
  ns::Advertise offer{
      .service = "map", .delivery = ns::Delivery::sync, .window = 1024, .retain = true};
  ASSERT_TRUE(ask<ns::AdvertiseAnswer>(robot, offer));
  const auto listed = ask<ns::ServicesAnswer>(robot, ns::ServicesRequest{});
  ASSERT_TRUE(listed);
  EXPECT_EQ(listed->services[0].window, 1024u);
  EXPECT_TRUE(listed->services[0].retain);
  offer.window = 1025;
  EXPECT_EQ(ask<ns::AdvertiseAnswer>(robot, offer).error().status, Status::bad_request);
  offer.delivery = ns::Delivery::stream;
  offer.window = 1;
  EXPECT_EQ(ask<ns::AdvertiseAnswer>(robot, offer).error().status, Status::bad_request);
  const ns::Advertise accepts{
      .service = "drive", .direction = ns::Direction::accepts, .retain = true};
  EXPECT_EQ(ask<ns::AdvertiseAnswer>(robot, accepts).error().status, Status::bad_request);
}

TEST_F(ServiceRequestsTest, ASubscriberMayWantLess) {
  const Node robot = join("robot");
  const Node viewer = join("viewer");
  const auto wants = [&](ns::Subscribe wanted) {
    wanted.name = "robot/map";
    return ask<ns::SubscribeAnswer>(viewer, wanted);
  };
  EXPECT_EQ(wants({.window = 2})->window, 0u) << "nobody provides it yet";
  ASSERT_TRUE(ask<ns::AdvertiseAnswer>(
      robot, ns::Advertise{
                 .service = "map", .delivery = ns::Delivery::sync, .window = 4, .retain = true}));
  EXPECT_EQ(wants({})->window, 4u);
  EXPECT_EQ(wants({.window = 3})->window, 3u);
  EXPECT_EQ(wants({.window = 1024, .depth = 64, .rate_hz = 1000.0})->window, 4u)
      << "at most what the service allows";
  EXPECT_TRUE(wants({})->retain);
  for (const ns::Subscribe& wrong :
       {ns::Subscribe{.window = 1025}, ns::Subscribe{.depth = 0}, ns::Subscribe{.depth = 65},
        ns::Subscribe{.rate_hz = 1000.1}, ns::Subscribe{.rate_hz = HUGE_VAL},
        ns::Subscribe{.rate_hz = NAN}, ns::Subscribe{.rate_hz = 0.0009},
        ns::Subscribe{.rate_hz = -1.0}}) {
    const auto answer = wants(wrong);
    ASSERT_FALSE(answer);
    EXPECT_EQ(answer.error().status, Status::bad_request);
    EXPECT_NE(answer.error().sentence.find("must be"), std::string::npos);
  }
}

TEST_F(ServiceRequestsTest, BadTermsAreRefused) {
  const Node robot = join("robot");
  for (const char* name : {"a/b", "", "a b", "*"}) {
    const auto answer = ask<ns::AdvertiseAnswer>(robot, ns::Advertise{.service = name});
    ASSERT_FALSE(answer) << name;
    EXPECT_EQ(answer.error().status, Status::bad_request);
  }
  const auto direction = static_cast<ns::Direction>(2);
  EXPECT_EQ(ask<ns::AdvertiseAnswer>(robot, ns::Advertise{.service = "a", .direction = direction})
                .error()
                .status,
            Status::bad_request);
  const auto delivery = static_cast<ns::Delivery>(3);
  EXPECT_EQ(ask<ns::AdvertiseAnswer>(robot, ns::Advertise{.service = "a", .delivery = delivery})
                .error()
                .status,
            Status::bad_request);
}

TEST_F(ServiceRequestsTest, AReturningNodeFindsItsServiceWhereItWas) {
  const Node robot = join("robot");
  const auto before = ask<ns::AdvertiseAnswer>(robot, ns::Advertise{.service = "odom"});
  detach(robot);
  proto::Hello hello;
  hello.token = robot.welcome.token;
  const Node back = join(hello);
  const auto after = ask<ns::AdvertiseAnswer>(back, ns::Advertise{.service = "odom"});
  EXPECT_EQ(after->group, before->group);
}

TEST_F(ServiceRequestsTest, CountsBeginWithAnAnswerOfAnotherNumber) {
  const Node robot = join("robot");
  const Node viewer = join("viewer");
  ns::Advertise offer{.service = "map", .delivery = ns::Delivery::sync, .window = 4};
  const auto map = ask<ns::AdvertiseAnswer>(robot, offer);
  ASSERT_TRUE(map);
  const auto begun = [&](ns::Subscribe wanted) {
    shards.sent.clear();
    const auto answer = ask<ns::SubscribeAnswer>(viewer, wanted);
    EXPECT_TRUE(answer);
    EXPECT_EQ(answer->number, wanted.number);
    const auto& counts = shards.all<SendControlCommand>().back()->counts;
    if (counts) {
      EXPECT_EQ(counts->group, map->group);
    }
    return counts ? std::optional{counts->number} : std::nullopt;
  };
  EXPECT_EQ(begun({.name = "robot/map", .number = 7}), 7);
  EXPECT_EQ(shards.all<PaceCommand>().size(), 1u);
  EXPECT_EQ(begun({.name = "robot/map", .number = 7}), std::nullopt) << "it is only repeated";
  EXPECT_EQ(begun({.name = "robot/map", .window = 2, .number = 7}), std::nullopt);
  EXPECT_EQ(begun({.name = "robot/map", .window = 2, .number = 8}), 8);
  offer = {.service = "odom"};
  ASSERT_TRUE(ask<ns::AdvertiseAnswer>(robot, offer));
  EXPECT_EQ(begun({.name = "robot/odom", .number = 9}), std::nullopt) << "nothing is counted";
}

TEST_F(ServiceRequestsTest, WhatStandsOutlivesALoweredLimitAndAReturn) {
  Node robot = join("robot");
  ns::Advertise offer{.service = "map", .delivery = ns::Delivery::sync, .window = 5};
  const ns::Subscribe all{.name = "a/b", .window = 5, .depth = 10, .rate_hz = 300.0};
  const auto before = ask<ns::AdvertiseAnswer>(robot, offer);
  ASSERT_TRUE(before);
  ASSERT_TRUE(ask<ns::SubscribeAnswer>(robot, all));
  limits.sync_window = 2;
  limits.subscription_depth = 2;
  limits.subscription_rate_hz = 2;
  proto::Hello hello;
  hello.token = robot.welcome.token;
  detach(robot);
  robot = join(hello);
  const auto after = ask<ns::AdvertiseAnswer>(robot, offer);
  ASSERT_TRUE(after) << after.error().sentence;
  EXPECT_EQ(after->group, before->group);
  EXPECT_TRUE(ask<ns::SubscribeAnswer>(robot, all));
  offer.metadata = "new";
  EXPECT_TRUE(ask<ns::AdvertiseAnswer>(robot, offer)) << "n is what it was";
  const auto with = [&](auto member, auto value) {
    ns::Subscribe changed = all;
    changed.*member = value;
    return ask<ns::SubscribeAnswer>(robot, changed).has_value();
  };
  // Each value that changes is held to its limit, the others stand.
  EXPECT_FALSE(with(&ns::Subscribe::window, 4u));
  EXPECT_FALSE(with(&ns::Subscribe::depth, 9u));
  EXPECT_FALSE(with(&ns::Subscribe::rate_hz, 200.0));
  EXPECT_TRUE(with(&ns::Subscribe::window, 2u));
  EXPECT_FALSE(with(&ns::Subscribe::window, 5u)) << "it does not stand any more";
  offer.window = 4;
  EXPECT_FALSE(ask<ns::AdvertiseAnswer>(robot, offer));
  const Node other = join("other");
  offer.window = 5;
  EXPECT_FALSE(ask<ns::AdvertiseAnswer>(other, offer)) << "it stands for another node";
  EXPECT_FALSE(ask<ns::SubscribeAnswer>(other, all));
}

TEST_F(ServiceRequestsTest, SubscribingTellsTheTerms) {
  const Node robot = join("robot");
  const Node viewer = join("viewer");
  const auto early = ask<ns::SubscribeAnswer>(viewer, ns::Subscribe{"robot/odom"});
  ASSERT_TRUE(early);
  EXPECT_EQ(early->group, GroupId{});
  const auto group =
      ask<ns::AdvertiseAnswer>(robot, ns::Advertise{.service = "odom", .message_type = 5});
  const auto later = ask<ns::SubscribeAnswer>(viewer, ns::Subscribe{"robot/odom"});
  ASSERT_TRUE(later);
  EXPECT_EQ(later->group, group->group);
  EXPECT_EQ(later->message_type, 5u);
}

TEST_F(ServiceRequestsTest, SubscribersAreToldThatAServiceAcceptsData) {
  const Node robot = join("robot");
  const Node viewer = join("viewer");
  ASSERT_TRUE(ask<ns::SubscribeAnswer>(viewer, ns::Subscribe{"robot/drive"}));
  shards.sent.clear();
  for (const ns::Direction direction : {ns::Direction::accepts, ns::Direction::provides}) {
    ASSERT_TRUE(
        ask<ns::AdvertiseAnswer>(robot, ns::Advertise{.service = "drive", .direction = direction}));
    const auto told =
        proto::decode<ns::ServiceMoved>(payload_of(*shards.all<SendControlCommand>()[0]));
    ASSERT_TRUE(told);
    EXPECT_EQ(told->direction, direction);
    const auto answer = ask<ns::SubscribeAnswer>(viewer, ns::Subscribe{"robot/drive"});
    ASSERT_TRUE(answer);
    EXPECT_EQ(answer->direction, direction);
    shards.sent.clear();
  }
}

TEST_F(ServiceRequestsTest, WithdrawingAndUnsubscribing) {
  const Node robot = join("robot");
  const Node viewer = join("viewer");
  const auto group = ask<ns::AdvertiseAnswer>(robot, ns::Advertise{.service = "odom"});
  ASSERT_TRUE(ask<ns::SubscribeAnswer>(viewer, ns::Subscribe{"robot/odom"}));
  EXPECT_EQ(ask<ns::WithdrawAnswer>(viewer, ns::Withdraw{group->group}).error().status,
            Status::denied);
  ASSERT_TRUE(ask<ns::UnsubscribeAnswer>(viewer, ns::Unsubscribe{"robot/odom"}));
  EXPECT_EQ(events<ns::Subscribers>().size(), 2u);
  EXPECT_EQ(ask<ns::UnsubscribeAnswer>(viewer, ns::Unsubscribe{"robot/odom"}).error().status,
            Status::not_found);
  ASSERT_TRUE(ask<ns::WithdrawAnswer>(robot, ns::Withdraw{group->group}));
  EXPECT_FALSE(groups.find(index_of(group->group))->provided());
  EXPECT_EQ(ask<ns::WithdrawAnswer>(robot, ns::Withdraw{group->group}).error().status,
            Status::not_found);
  EXPECT_EQ(
      ask<ns::WithdrawAnswer>(robot, ns::Withdraw{make_id<GroupId>(HubId{9}, 1)}).error().status,
      Status::not_found);
}

TEST_F(ServiceRequestsTest, ServicesAreListedByPatternAndInPages) {
  const Node robot = join("robot");
  const std::string metadata(proto::kMetadataBytesMax, 'm');
  for (int i = 0; i < 40; ++i) {
    const std::string name = "s" + std::to_string(i);
    ASSERT_TRUE(
        ask<ns::AdvertiseAnswer>(robot, ns::Advertise{.service = name, .metadata = metadata}));
  }
  EXPECT_EQ(
      ask<ns::ServicesAnswer>(robot, ns::ServicesRequest{.pattern = "robot/s7"})->services.size(),
      1u);
  EXPECT_EQ(ask<ns::ServicesAnswer>(robot, ns::ServicesRequest{.pattern = "**/"}).error().status,
            Status::bad_request);
  std::size_t seen = 0;
  GroupId after{};
  for (int page = 0; page < 10; ++page) {
    const auto answer = ask<ns::ServicesAnswer>(robot, ns::ServicesRequest{.after = after});
    ASSERT_TRUE(answer);
    EXPECT_LE(std::get<SendControlCommand>(shards.sent.back().command).frame.size(),
              proto::kHeaderSize + limits.frame_bytes);
    seen += answer->services.size();
    if (!answer->more) break;
    after = answer->services.back().group;
  }
  EXPECT_EQ(seen, 40u);
}

TEST_F(ServiceRequestsTest, ANodeHasAsManyServicesAsTheLimitSaysAndNoMore) {
  const Node robot = join("robot");
  EXPECT_TRUE(ask<ns::ServicesAnswer>(robot, ns::ServicesRequest{})->services.empty());
  for (std::uint64_t i = 0; i < limits.services_per_node; ++i) {
    ASSERT_TRUE(ask<ns::AdvertiseAnswer>(robot, ns::Advertise{.service = "s" + std::to_string(i)}))
        << i;
    if (i + 1 == 1 || i + 1 == 100) {
      EXPECT_EQ(ask<ns::ServicesAnswer>(robot, ns::ServicesRequest{.pattern = "robot/*"})
                    ->services.size(),
                i + 1);
    }
  }
  EXPECT_EQ(conductor.membership().services().services_of(node_index_of(robot.id)), 1'024u);
  const auto one_more = ask<ns::AdvertiseAnswer>(robot, ns::Advertise{.service = "one-more"});
  ASSERT_FALSE(one_more);
  EXPECT_EQ(one_more.error().status, Status::limit);
  EXPECT_NE(one_more.error().sentence.find("1024 services"), std::string::npos)
      << one_more.error().sentence;
  EXPECT_TRUE(ask<ns::AdvertiseAnswer>(robot, ns::Advertise{.service = "s7"}))
      << "one that is there already";
}

TEST_F(ServiceRequestsTest, SubscriptionsAreRefusedBeyondTheLimit) {
  const Node viewer = join("viewer");
  for (std::uint64_t i = 0; i < limits.subscriptions_per_node; ++i) {
    ASSERT_TRUE(ask<ns::SubscribeAnswer>(viewer, ns::Subscribe{"nobody/s" + std::to_string(i)}))
        << i;
  }
  EXPECT_EQ(ask<ns::SubscribeAnswer>(viewer, ns::Subscribe{"nobody/one-more"}).error().status,
            Status::limit);
  ASSERT_TRUE(ask<ns::UnsubscribeAnswer>(viewer, ns::Unsubscribe{"nobody/s0"}));
  EXPECT_TRUE(ask<ns::SubscribeAnswer>(viewer, ns::Subscribe{"nobody/one-more"}));
}

TEST_F(ServiceRequestsTest, AllThatANodeMayHaveItMayDeclareAtOnceAndOneThingMoreIsTooMuch) {
  const Node robot = join("robot");
  const auto declare = [&](const Node& node) {
    for (std::uint64_t i = 0; i < limits.services_per_node; ++i) {
      ASSERT_TRUE(ask<ns::AdvertiseAnswer>(node, ns::Advertise{.service = "s" + std::to_string(i)}))
          << i;
    }
    for (std::uint64_t i = 0; i < limits.subscriptions_per_node; ++i) {
      ASSERT_TRUE(ask<ns::SubscribeAnswer>(node, ns::Subscribe{"nobody/s" + std::to_string(i)}))
          << i;
    }
  };
  declare(robot);
  ASSERT_TRUE(ask<ns::UnsubscribeAnswer>(robot, ns::Unsubscribe{"nobody/s0"}))
      << "ending something is free";
  const auto more = ask<ns::SubscribeAnswer>(robot, ns::Subscribe{"nobody/s0"});
  ASSERT_FALSE(more);
  EXPECT_EQ(more.error().status, Status::rate);
  EXPECT_NE(more.error().sentence.find("2048 at once and 500 a second"), std::string::npos)
      << more.error().sentence;
  now += 2ms;
  EXPECT_TRUE(ask<ns::SubscribeAnswer>(robot, ns::Subscribe{"nobody/s0"}));
  // Whose connection flaps declares all of it each time, and that is free.
  proto::Hello hello;
  hello.token = robot.welcome.token;
  for (int flap = 0; flap < 3; ++flap) declare(join(hello));
}

TEST_F(ServiceRequestsTest, LargerQuotasMakeTheBurstLarger) {
  limits.declarations_burst = 1;
  limits.services_per_node = 5;
  limits.subscriptions_per_node = 5;
  const Node robot = join("robot");
  for (int i = 0; i < 5; ++i) {
    EXPECT_TRUE(ask<ns::AdvertiseAnswer>(robot, ns::Advertise{.service = "s" + std::to_string(i)}));
    EXPECT_TRUE(ask<ns::SubscribeAnswer>(robot, ns::Subscribe{"nobody/s" + std::to_string(i)}));
  }
  // Other terms are another declaration, the same ones are none.
  EXPECT_TRUE(ask<ns::AdvertiseAnswer>(robot, ns::Advertise{.service = "s0"}));
  EXPECT_TRUE(ask<ns::SubscribeAnswer>(robot, ns::Subscribe{"nobody/s0"}));
  EXPECT_EQ(ask<ns::AdvertiseAnswer>(robot, ns::Advertise{.service = "s0", .metadata = "new"})
                .error()
                .status,
            Status::rate);
  EXPECT_EQ(ask<ns::SubscribeAnswer>(robot, ns::Subscribe{.name = "nobody/s0", .depth = 2})
                .error()
                .status,
            Status::rate);
}

TEST_F(ServiceRequestsTest, AStormOfSubscriptionsEndsAtTheQuotaAndThenAtTheRate) {
  const Node robot = join("robot");
  ASSERT_TRUE(ask<ns::AdvertiseAnswer>(robot, ns::Advertise{.service = "s"}));
  const Node viewer = join("viewer");
  std::map<Status, int> said;
  for (int i = 0; i < 100'000; ++i) {
    const auto answer =
        ask<ns::SubscribeAnswer>(viewer, ns::Subscribe{"nobody/s" + std::to_string(i)});
    ++said[answer ? Status::done : answer.error().status];
    shards.sent.clear();
  }
  EXPECT_EQ(said[Status::done], 1'024);
  EXPECT_EQ(said[Status::limit], 1'024);
  EXPECT_EQ(said[Status::rate], 100'000 - 2'048);
  EXPECT_EQ(conductor.membership().topics().by_name().size(), 1'024u + 1);
  // A provider is told of no more comings and goings than the rate allows.
  const Node other = join("other");
  for (int i = 0; i < 100'000; ++i) {
    static_cast<void>(ask<ns::SubscribeAnswer>(other, ns::Subscribe{"robot/s"}));
    static_cast<void>(ask<ns::UnsubscribeAnswer>(other, ns::Unsubscribe{"robot/s"}));
    said[Status::taken] += static_cast<int>(events<ns::Subscribers>().size());
    shards.sent.clear();
  }
  EXPECT_EQ(said[Status::taken], 2 * 2'048) << "each comes and goes";
}

}  // namespace
}  // namespace gimnet::hub
