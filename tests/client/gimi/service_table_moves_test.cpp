#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "client/gimi/service_table.hpp"
#include "proto/control/link.hpp"
#include "proto/control/ns.hpp"
#include "tests/client/gimi/support/conversation.hpp"

// Services that have other group ids after a break: a hub that lost its state gives them anew, in
// the order in which it is asked, so that one has the former id of another.

namespace gimnet::gimi {
namespace {

using test::Conversation;
using test::kKey;
using test::kOwnId;
using test::kPeerId;
using test::MessageOperation;

namespace ns = proto::ns;

constexpr std::uint32_t kFirst = (7u << 20) | 11;
constexpr std::uint32_t kSecond = (7u << 20) | 12;

/// In the place of a group: the hub does not take the subscription.
constexpr std::uint32_t kRefused = ~std::uint32_t{0};

using Groups = std::map<std::string, std::uint32_t>;

/// The parameter: the service of which the hub tells first.
class MovedServices : public Conversation, public testing::WithParamInterface<const char*> {
 protected:
  MovedServices() : Conversation(true) {}
  /// So that what the test declared need not wait for an answer when it goes.
  void close_node() {
    hub_.close();
    node_->close();
  }

  [[nodiscard]] Publisher advertise(const std::string& name, std::uint32_t group) {
    PublishOptions options;
    options.key = kKey;
    std::optional<Publisher> made;
    std::thread asking([&] { made.emplace(node_->advertise(name, options).or_throw()); });
    answer_all<ns::Advertise>({{name, group}});
    asking.join();
    return *made;
  }

  [[nodiscard]] Subscription subscribe(const std::string& name, std::uint32_t group) {
    std::optional<Subscription> made;
    std::thread asking([&] { made.emplace(node_->subscribe(name).or_throw()); });
    answer_all<ns::Subscribe>({{name, group}});
    asking.join();
    return *made;
  }

  /// The connection breaks, and what the node declares again by Request gets those groups; 0: is
  /// refused.
  template <class Request>
  void come_back(const Groups& groups) {
    hub_.close();
    proto::Welcome welcome = nif::test::make_welcome(resume_bytes_);
    welcome.resumed = resumes_;
    hub_ = fake_.admit(welcome);
    answer_all<Request>(groups);
    settle_down();
  }

  /// Returns when the node has handled everything that the hub said before.
  void settle_down() {
    answer({++sequence_, MessageOperation::data, 0, 0}, {});
    EXPECT_EQ(node_->receive(kKey, kForever)->sequence(), sequence_);
  }

  void expect_published(const Publisher& publisher, std::uint32_t group) {
    publisher.publish(publisher.name(), kForever).or_throw();
    const test::Taken taken = next();
    EXPECT_EQ(taken.data, publisher.name());
    EXPECT_EQ(taken.frame.dst, group) << publisher.name();
  }

  /// A message that comes for the group.
  void expect_received(const Subscription& subscription, std::uint32_t group) {
    send_to(group, subscription.name());
    const auto message = subscription.try_receive();
    ASSERT_TRUE(message) << subscription.name();
    EXPECT_EQ(message->text(), subscription.name());
  }
  void expect_ignored(const Subscription& subscription, std::uint32_t group) {
    send_to(group, subscription.name());
    EXPECT_FALSE(subscription.try_receive());
  }
  void send_to(std::uint32_t group, const std::string& text) {
    proto::FrameParts parts;
    parts.header.kind = proto::Kind::group;
    parts.header.dst = group;
    parts.header.src = kPeerId;
    parts.key = proto::gimi::StreamKey{kKey.type, kKey.instance}.value();
    std::string header(proto::gimi::kMessageHeaderSize, '\0');
    header[4] = static_cast<char>(++sequence_);
    hub_.send(parts, header + text);
    settle_down();
  }

  std::uint32_t sequence_ = 0;
  std::uint32_t resume_bytes_ = 0;
  bool resumes_ = false;

 private:
  static const std::string& name_of(const ns::Advertise& request) { return request.service; }
  static const std::string& name_of(const ns::Subscribe& request) { return request.name; }
  static proto::Payload answer_to(const ns::Advertise& /*request*/, std::uint32_t group,
                                  std::uint16_t number) {
    if (group != 0) return proto::encode_answer(ns::AdvertiseAnswer{GroupId{group}, 1}, number);
    return proto::encode_refusal({ns::Advertise::kOperation, number},
                                 {proto::Status::limit, "no more"});
  }
  static proto::Payload answer_to(const ns::Subscribe& /*request*/, std::uint32_t group,
                                  std::uint16_t number) {
    if (group == kRefused) {
      return proto::encode_refusal({ns::Subscribe::kOperation, number},
                                   {proto::Status::limit, "no more"});
    }
    ns::SubscribeAnswer answer;
    answer.group = GroupId{group};
    answer.provider = NodeId{kPeerId};
    return proto::encode_answer(answer, number);
  }

  template <class Request>
  void answer_all(const Groups& groups) {
    std::map<std::string, proto::Payload> answers;
    for (std::size_t i = 0; i < groups.size(); ++i) {
      std::uint16_t number = 0;
      const auto request = hub_.next_request<Request>(number);
      ASSERT_TRUE(request);
      const std::string& name = name_of(*request);
      ASSERT_TRUE(groups.contains(name)) << name;
      answers.emplace(name, answer_to(*request, groups.at(name), number));
    }
    if (auto first = answers.extract(GetParam()))
      hub_.send_control(proto::Kind::ns, first.mapped());
    for (const auto& [name, payload] : answers) hub_.send_control(proto::Kind::ns, payload);
  }
};

class MovedOwnServices : public MovedServices {};
class MovedSubscriptions : public MovedServices {};

TEST_P(MovedOwnServices, ArePublishedToTheirOwnSubscribers) {
  const Publisher odometry = advertise("odom", kFirst);
  const Publisher map = advertise("map", kSecond);
  come_back<ns::Advertise>({{"odom", kSecond}, {"map", kFirst}});
  expect_published(odometry, kSecond);
  expect_published(map, kFirst);
  come_back<ns::Advertise>({{"odom", kFirst}, {"map", kSecond}});
  expect_published(odometry, kFirst);
  expect_published(map, kSecond);
  close_node();
}

TEST_P(MovedOwnServices, SayWhyTheyAreNotThereAnyMore) {
  const Publisher odometry = advertise("odom", kFirst);
  const Publisher map = advertise("map", kSecond);
  EXPECT_TRUE(map.standing());
  come_back<ns::Advertise>({{"odom", kFirst}, {"map", 0}});
  EXPECT_TRUE(odometry.standing());
  const auto stands = map.standing();
  ASSERT_TRUE(stands.is(Status::limit));
  EXPECT_NE(stands.failure().sentence.find("robot/map: the hub did not take the service again"),
            std::string::npos);
  EXPECT_NE(stands.failure().sentence.find("no more"), std::string::npos);
  EXPECT_TRUE(map.publish("x", kForever).is(Status::refused));
  come_back<ns::Advertise>({{"odom", kFirst}, {"map", kSecond}});
  EXPECT_TRUE(map.standing());
  close_node();
}

TEST_P(MovedOwnServices, CountTheirOwnSubscribers) {
  const Publisher odometry = advertise("odom", kFirst);
  const Publisher map = advertise("map", kSecond);
  come_back<ns::Advertise>({{"odom", kSecond}, {"map", kFirst}});
  for (const auto& [group, count] :
       std::map<std::uint32_t, std::uint32_t>{{kFirst, 5}, {kSecond, 6}}) {
    hub_.send_control(proto::Kind::ns, proto::encode(ns::Subscribers{GroupId{group}, count}));
  }
  settle_down();
  EXPECT_EQ(map.subscribers(), 5u);
  EXPECT_EQ(odometry.subscribers(), 6u);
  close_node();
}

TEST_P(MovedOwnServices, LearnHowManySubscribersThereAreAfterABreak) {
  const Publisher odometry = advertise("odom", kFirst);
  const Publisher map = advertise("map", kSecond);
  resume_bytes_ = 1 << 20;
  come_back<ns::Advertise>({{"odom", kFirst}, {"map", kSecond}});
  for (const std::uint32_t group : {kFirst, kSecond}) {
    hub_.send_control(proto::Kind::ns, proto::encode(ns::Subscribers{GroupId{group}, 0}));
  }
  settle_down();
  EXPECT_EQ(odometry.subscribers(), 0u);
  resumes_ = true;
  come_back<ns::Advertise>({{"odom", kFirst}, {"map", kSecond}});
  EXPECT_EQ(odometry.subscribers(), 1u) << "who came meanwhile would get nothing";
  expect_published(odometry, kFirst);
  expect_published(map, kSecond);
  close_node();
}

TEST_P(MovedOwnServices, ComeBackAfterAHubThatRefusedThem) {
  const Publisher odometry = advertise("odom", kFirst);
  const Publisher map = advertise("map", kSecond);
  come_back<ns::Advertise>({{"odom", 0}, {"map", 0}});
  EXPECT_TRUE(odometry.publish("x", kForever).is(Status::refused));
  come_back<ns::Advertise>({{"odom", kSecond}, {"map", kFirst}});
  expect_published(odometry, kSecond);
  expect_published(map, kFirst);
  close_node();
}

// As a loop that steers a robot would: nobody may keep it.
TEST_P(MovedOwnServices, KeepNobodyWaitingForLongerThanItWants) {
  const Publisher odometry = advertise("odom", kFirst);
  hub_.close();
  while (node_->state().connected) std::this_thread::yield();
  EXPECT_TRUE(odometry.publish("x", kForever).is(Status::not_connected)) << "the hub is away";
  EXPECT_EQ(odometry.unsent(), 1u);
  hub_ = fake_.admit(nif::test::make_welcome());
  std::uint16_t declared = 0;
  ASSERT_TRUE(hub_.next_request<ns::Advertise>(
      declared));  // until it is answered nobody knows where to send
  EXPECT_TRUE(odometry.publish("x", kNoWait).is(Status::timeout));
  EXPECT_TRUE(odometry.publish("x").is(Status::timeout)) << "nor for ever by itself";
  std::thread waiting([&] { odometry.publish("at last", kForever, More::no).or_throw(); });
  EXPECT_TRUE(odometry.publish("x", kNoWait).is(Status::timeout)) << "nor for the other thread";
  hub_.send_control(proto::Kind::ns,
                    proto::encode_answer(ns::AdvertiseAnswer{GroupId{kFirst}, 1}, declared));
  waiting.join();
  EXPECT_EQ(next().data, "at last");
  EXPECT_EQ(odometry.published(), 1u);
  close_node();
}

TEST_P(MovedOwnServices, AreWithdrawnWhileTheyMove) {
  std::optional<Publisher> odometry = advertise("odom", kFirst);
  hub_.close();
  hub_ = fake_.admit(nif::test::make_welcome());
  std::uint16_t declared = 0;
  ASSERT_TRUE(hub_.next_request<ns::Advertise>(declared));
  std::thread leaving([&] { odometry.reset(); });
  std::uint16_t former = 0;
  ASSERT_TRUE(hub_.next_request<ns::Withdraw>(former));
  hub_.send_control(proto::Kind::ns,
                    proto::encode_answer(ns::AdvertiseAnswer{GroupId{kSecond}, 0}, declared));
  std::uint16_t now = 0;
  const auto request = hub_.next_request<ns::Withdraw>(now);
  ASSERT_TRUE(request);
  EXPECT_EQ(request->group, GroupId{kSecond});
  hub_.send_control(proto::Kind::ns, proto::encode_answer(ns::WithdrawAnswer{}, now));
  const proto::ControlHeader header{ns::Withdraw::kOperation, former};
  hub_.send_control(proto::Kind::ns,
                    proto::encode_refusal(header, {proto::Status::not_found, "no such service"}));
  leaving.join();
}

TEST_P(MovedSubscriptions, GetTheirOwnMessages) {
  const Subscription odometry = subscribe("robot/odom", kFirst);
  const Subscription map = subscribe("robot/map", kSecond);
  for (int i = 0; i < 3; ++i) {
    come_back<ns::Subscribe>({{"robot/odom", kSecond}, {"robot/map", kFirst}});
    expect_received(odometry, kSecond);
    expect_received(map, kFirst);
    come_back<ns::Subscribe>({{"robot/odom", kFirst}, {"robot/map", kSecond}});
    expect_received(odometry, kFirst);
    expect_received(map, kSecond);
  }
  close_node();
}

TEST_P(MovedSubscriptions, StandAgainWhereTheHubTakesThemWithOrWithoutAProvider) {
  const Subscription odometry = subscribe("robot/odom", kFirst);
  const Subscription map = subscribe("robot/map", 0);
  come_back<ns::Subscribe>({{"robot/odom", kRefused}, {"robot/map", kRefused}});
  for (const Subscription& refused : {odometry, map}) {
    const auto stands = refused.standing();
    ASSERT_TRUE(stands.is(Status::limit));
    EXPECT_NE(stands.failure().sentence.find("no more"), std::string::npos);
  }
  come_back<ns::Subscribe>({{"robot/odom", kSecond}, {"robot/map", 0}});
  EXPECT_TRUE(odometry.standing());
  EXPECT_TRUE(map.standing());
  expect_received(odometry, kSecond);
  close_node();
}

/// The answer is here, and the asking thread has not entered the service yet.
TEST(ServiceTable, AMoveWaitsForTheServiceThatIsJustAdvertised) {
  nif::test::FakeHub hub;
  nif::test::Connected connected =
      nif::test::connect_to(hub, nif::test::default_options("robot"), nif::test::make_welcome());
  Uplink uplink;
  uplink.open(connected.node.get());
  Inbox inbox(1, 1 << 20, [] {});
  ServiceTable table(uplink, inbox, [](const std::string&, const ServicePlace&) {});
  EXPECT_EQ(table.on_own_service_moved("odom", {kFirst, kSecond}), ServiceTable::Place::unknown);
  PublishedService* odometry = nullptr;
  std::thread asking([&] { odometry = table.advertise("robot", "odom", {}, kForever).or_throw(); });
  std::uint16_t number = 0;
  ASSERT_TRUE(connected.hub.next_request<ns::Advertise>(number));
  EXPECT_EQ(table.on_own_service_moved("odom", {kFirst, kSecond}), ServiceTable::Place::not_yet);
  EXPECT_EQ(table.on_own_service_moved("map", {kFirst, kSecond}), ServiceTable::Place::unknown)
      << "nobody asks for it";
  connected.hub.send_control(proto::Kind::ns,
                             proto::encode_answer(ns::AdvertiseAnswer{GroupId{kFirst}, 0}, number));
  asking.join();
  EXPECT_EQ(table.on_own_service_moved("odom", {kSecond, 99}), ServiceTable::Place::unknown)
      << "of an earlier one";
  EXPECT_EQ(table.on_own_service_moved("odom", {kFirst, kSecond}), ServiceTable::Place::found);
  EXPECT_EQ(odometry->group(), kSecond);
  connected.hub.close();
}

/// A program that has read a service goes on sending to it: the hub is asked once more, now without
/// a pace.
TEST(ServiceTable, AMoveWaitsForTheServiceThatIsJustNotReadAnyMore) {
  nif::test::FakeHub hub;
  nif::test::Connected connected =
      nif::test::connect_to(hub, nif::test::default_options(), nif::test::make_welcome());
  Uplink uplink;
  uplink.open(connected.node.get());
  Inbox inbox(1, 1 << 20, [] {});
  ServiceTable table(uplink, inbox, [](const std::string&, const ServicePlace&) {});
  const auto answer_one = [&](std::uint32_t group, const auto& meanwhile) {
    std::uint16_t number = 0;
    ASSERT_TRUE(connected.hub.next_request<ns::Subscribe>(number));
    meanwhile();
    ns::SubscribeAnswer answer;
    answer.group = GroupId{group};
    answer.provider = NodeId{kPeerId};
    connected.hub.send_control(proto::Kind::ns, proto::encode_answer(answer, number));
  };
  std::thread asking([&] {
    const auto reading =
        table.subscribe("robot/odom", {.timeout = kForever, .window = 2}).or_throw();
    static_cast<void>(table.follow("robot/odom", kForever, [](const ServicePlace&) {
      return Outcome<ServiceTable::Stream>(Failure{Status::denied, "there is nothing to send"});
    }));
    table.unsubscribe(reading);
  });
  answer_one(kFirst, [] {});
  nif_incoming moved{};
  moved.text = "robot/odom";
  moved.group = kSecond;
  moved.from = kPeerId;
  answer_one(kFirst,
             [&] { EXPECT_EQ(table.on_service_moved(moved), ServiceTable::Place::not_yet); });
  asking.join();
  EXPECT_EQ(table.on_service_moved(moved), ServiceTable::Place::found);
  EXPECT_EQ(table.subscribed(kSecond).place, ServiceTable::Place::unwanted);
  connected.hub.close();
}

TEST_P(MovedSubscriptions, TakeWhatWaitedOfTheFormerGroup) {
  const Subscription odometry = subscribe("robot/odom", kFirst);
  const Subscription map = subscribe("robot/map", kSecond);
  ns::ServiceMoved moved;
  moved.name = "robot/odom";
  moved.provider = NodeId{kPeerId};
  for (const std::uint32_t next : {100u, 101u}) {
    moved.group = GroupId{(7u << 20) | next};
    hub_.send_control(proto::Kind::ns, proto::encode(moved));
    settle_down();
    expect_received(odometry, next == 100 ? kFirst : (7u << 20) | 100);
    expect_received(odometry, moved.group.value());
  }
  expect_received(map, kSecond);
  expect_ignored(odometry, kFirst);
  close_node();
}

INSTANTIATE_TEST_SUITE_P(ServiceTable, MovedOwnServices, testing::Values("map", "odom"),
                         [](const auto& first) { return std::string(first.param) + "First"; });
INSTANTIATE_TEST_SUITE_P(ServiceTable, MovedSubscriptions,
                         testing::Values("robot/map", "robot/odom"), [](const auto& first) {
                           return std::string(first.param).substr(6) + "First";
                         });

}  // namespace
}  // namespace gimnet::gimi
