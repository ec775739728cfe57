#include "client/gimi/services.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "base/clock.hpp"
#include "gimnet/gimi.hpp"
#include "proto/control/ns.hpp"
#include "proto/frame/extensions.hpp"
#include "tests/client/gimi/support/conversation.hpp"
#include "tests/client/gimi/support/hub_process.hpp"

// Every wish of a subscriber, of services of every delivery.

namespace gimnet {
namespace {

using test::eventually;
using test::HubProcess;
using testing::ElementsAre;

constexpr Timeout kWait = std::chrono::duration_cast<Timeout>(test::kPatience);

using Texts = std::vector<std::string>;

constexpr int kMessages = 80;  ///< more than a queue of a key has places without a wish
constexpr int kBurst = 20'000;
constexpr std::uint32_t kWindow = 3;
constexpr double kRate = 5.0;

/// The texts of messages from one number to another.
Texts numbers(int first, int last) {
  Texts texts;
  for (int i = first; i <= last; ++i) texts.push_back(std::to_string(i));
  return texts;
}

class Wishes : public testing::Test {
 protected:
  void offer(Delivery delivery, std::uint32_t window = 1) {
    publisher_.reset();
    publisher_ = robot_.advertise("eye", {.delivery = delivery, .window = window}).or_throw();
  }
  Subscription subscribe(const SubscribeOptions& wish) {
    Subscription made = viewer_.subscribe("robot/eye", wish).or_throw();
    publisher_->wait_for_subscribers(1, kWait).or_throw();
    return made;
  }
  void publish(int number) { publisher_->publish(std::to_string(number), kForever).or_throw(); }
  /// One after the other is with the subscriber before the next one is published.
  void publish_slowly(const Subscription& subscription) {
    for (int i = 1; i <= kMessages; ++i) {
      publish(i);
      ASSERT_TRUE(eventually([&] { return subscription.queue().received() == std::uint64_t(i); }))
          << i;
    }
  }
  /// The hub has all of them before the subscriber takes the first one.
  void publish_at_once() {
    for (int i = 1; i <= kMessages; ++i) publish(i);
    pass_the_hub();
  }
  void pass_the_hub() { ASSERT_TRUE(robot_.ping(viewer_.peer(), kWait)); }
  /// Takes messages until the last one that was published.
  static Texts take(const Subscription& subscription) {
    Texts texts;
    while (texts.empty() || texts.back() != std::to_string(kMessages))
      texts.emplace_back(subscription.receive(kWait).or_throw().text());
    return texts;
  }
  Texts take_slow(const SubscribeOptions& wish) {
    const Subscription subscription = subscribe(wish);
    publish_slowly(subscription);
    return take(subscription);
  }
  Texts take_fast(const SubscribeOptions& wish) {
    const Subscription subscription = subscribe(wish);
    publish_at_once();
    return take(subscription);
  }
  /// With a rate the first one comes at once and the last one at the next due time, over the first.
  void expect_newest_when_due() {
    const Subscription subscription = subscribe({.rate_hz = kRate});
    publish_at_once();
    EXPECT_TRUE(eventually([&] { return subscription.queue().received() == 2; }));
    EXPECT_THAT(take(subscription), ElementsAre(std::to_string(kMessages)));
    EXPECT_EQ(subscription.missed(), std::uint64_t(kMessages) - 1);
  }

  HubProcess hub_;
  const Node robot_{"robot", hub_.url()};
  const Node viewer_{"", hub_.url()};
  std::optional<Publisher> publisher_;
};

TEST_F(Wishes, OfAStream) {
  offer(Delivery::stream);
  EXPECT_EQ(take_slow({}), numbers(1, kMessages));
  EXPECT_EQ(take_slow({.queue = 64}), numbers(kMessages - 63, kMessages)) << "64 places";
  EXPECT_EQ(take_slow({.newest_only = true}), numbers(kMessages, kMessages));
  EXPECT_EQ(take_slow({.queue = 100}), numbers(1, kMessages));
  expect_newest_when_due();
}

TEST_F(Wishes, WithoutOneAStreamHoldsABurstForAProgramThatReadsNothing) {
  offer(Delivery::stream);
  const Subscription all = subscribe({});
  for (int i = 1; i <= kBurst; ++i) publish(i);
  ASSERT_TRUE(eventually([&] { return all.queue().size() == kBurst; }));
  EXPECT_EQ(all.missed(), 0u);
  EXPECT_EQ(all.receive(kNoWait)->text(), "1");
  all.queue().resize(10);
  EXPECT_EQ(all.queue().size(), 10u);
  publish(kBurst + 1);
  ASSERT_TRUE(eventually([&] { return all.queue().received() == kBurst + 1; }));
  EXPECT_EQ(all.queue().size(), 10u) << "it has a wish now";
}

TEST_F(Wishes, OfTheLatest) {
  offer(Delivery::latest);
  EXPECT_EQ(take_slow({}), numbers(kMessages, kMessages));
  EXPECT_EQ(take_slow({.newest_only = true}), numbers(kMessages, kMessages));
  EXPECT_EQ(take_slow({.queue = 100}), numbers(1, kMessages)) << "all that came";
  expect_newest_when_due();
}

TEST_F(Wishes, OfAServiceInSync) {
  offer(Delivery::sync, kWindow);
  const Texts as_many_as_the_window{"1", "2", "3", std::to_string(kMessages)};
  EXPECT_EQ(take_fast({}), as_many_as_the_window);
  EXPECT_EQ(take_fast({.queue = 100}), as_many_as_the_window);
  EXPECT_EQ(take_slow({.newest_only = true}), numbers(kMessages, kMessages));
  expect_newest_when_due();
  offer(Delivery::sync, 1);
  EXPECT_THAT(take_fast({.newest_only = true}), ElementsAre("1", std::to_string(kMessages)))
      << "the service's window stays 1";
}

TEST_F(Wishes, OfAWindowOrADepthWorkWithEveryDelivery) {
  for (const Delivery delivery : {Delivery::stream, Delivery::sync}) {
    offer(delivery, kWindow);
    EXPECT_THAT(take_fast({.window = 2, .depth = 2}),
                ElementsAre("1", "2", std::to_string(kMessages - 1), std::to_string(kMessages)));
  }
  // Of those that are still at the hub the newest goes, so that fewer may come.
  offer(Delivery::latest);
  const Texts newest = take_fast({.queue = 100, .window = 2});
  EXPECT_LE(newest.size(), 3u);
}

TEST_F(Wishes, OfARateWorkBesideASubscriptionWithoutOne) {
  for (const Delivery delivery : {Delivery::stream, Delivery::latest, Delivery::sync}) {
    offer(delivery, kWindow);
    const Subscription every = subscribe({.queue = 100});
    expect_newest_when_due();
    EXPECT_EQ(take(every).back(), std::to_string(kMessages));
  }
}

TEST_F(Wishes, OfTwoRatesAreBothKept) {
  offer(Delivery::stream);
  const Subscription often = subscribe({.rate_hz = 100.0, .queue = 100});
  expect_newest_when_due();
  EXPECT_THAT(take(often), ElementsAre("1", std::to_string(kMessages)));
}

TEST_F(Wishes, OfARateReachAWaitSet) {
  offer(Delivery::stream);
  const Subscription every = subscribe({});
  const Subscription paced = subscribe({.rate_hz = kRate});
  const WaitSet set;
  set.add(paced, 7).or_throw();
  publish_at_once();
  EXPECT_THAT(set.wait(kWait).or_throw(), ElementsAre(7u));
  EXPECT_EQ(paced.receive(kNoWait)->text(), "1");
  EXPECT_THAT(set.wait(kWait).or_throw(), ElementsAre(7u));
  EXPECT_EQ(paced.receive(kNoWait)->text(), std::to_string(kMessages));
}

TEST_F(Wishes, TellSilenceFromTheEnd) {
  offer(Delivery::stream);
  const Subscription subscription = subscribe({.silence = Timeout{20}});
  EXPECT_TRUE(subscription.receive(kWait).is(Status::silence));
  publish(1);
  EXPECT_EQ(subscription.receive(kWait)->text(), "1");
  EXPECT_TRUE(subscription.receive(kWait).is(Status::silence)) << "again";
}

TEST_F(Wishes, ThatContradictEachOtherAreRefusedWithASentence) {
  const auto refused = viewer_.subscribe("robot/eye", {.newest_only = true, .queue = 2});
  ASSERT_TRUE(refused.is(Status::bad_argument));
  EXPECT_NE(refused.failure().sentence.find("leave one of them out"), std::string::npos);
}

TEST_F(Wishes, ARateThatIsNoneIsRefusedBesideASubscriptionWithoutOne) {
  const auto all = viewer_.subscribe("robot/eye").or_throw();
  for (const double rate_hz : {-1.0, 0.0009, std::nan(""), HUGE_VAL}) {
    const auto refused = viewer_.subscribe("robot/eye", {.rate_hz = rate_hz});
    EXPECT_TRUE(refused.is(Status::bad_argument)) << rate_hz;
  }
}

TEST_F(Wishes, EachSubscriptionHasAQueueOfItsOwn) {
  offer(Delivery::stream);
  const Subscription all = subscribe({.queue = 100});
  const Subscription newest = subscribe({.newest_only = true});
  publish_slowly(newest);
  EXPECT_EQ(take(all), numbers(1, kMessages));
  EXPECT_EQ(take(newest), numbers(kMessages, kMessages));
  EXPECT_EQ(all.missed(), 0u);
  EXPECT_EQ(newest.missed(), std::uint64_t(kMessages) - 1);
  EXPECT_EQ(publisher_->subscribers(), 1u) << "the hub sends once";
}

TEST_F(Wishes, WhatTheyMissIsToldToTheHub) {
  offer(Delivery::stream);
  const Subscription newest = subscribe({.newest_only = true});
  const auto told = [&] {
    const auto services = robot_.services("robot/eye").or_throw();
    return std::pair(services.at(0).missed, services.at(0).missed_most);
  };
  EXPECT_EQ(told(), std::pair(std::uint64_t{0}, Peer{}));
  publish_slowly(newest);
  EXPECT_TRUE(eventually([&] { return told().first == newest.missed(); }));
  EXPECT_EQ(told(), std::pair(std::uint64_t(kMessages) - 1, viewer_.peer()));
  for (const ConnectionRecord& each : robot_.hub_connections(kWait).or_throw())
    EXPECT_EQ(each.missed, each.node == viewer_.peer() ? newest.missed() : 0u);
}

TEST_F(Wishes, WhatOneMissesThatWantsAllIsToldOnStandardErrorIfThatIsAskedFor) {
  offer(Delivery::stream);
  ASSERT_EQ(setenv("GIMNET_LOG", "info", 1), 0);
  testing::internal::CaptureStderr();
  {
    const Subscription newest = subscribe({.newest_only = true});
    publish_slowly(newest);
    EXPECT_TRUE(eventually([&] { return robot_.services("robot/eye")->at(0).missed != 0; }));
  }
  std::string said = testing::internal::GetCapturedStderr();
  EXPECT_EQ(said.find("missed"), std::string::npos) << said;
  testing::internal::CaptureStderr();
  const Subscription two = subscribe({.queue = 2});
  publish_slowly(two);
  const auto is_told = [&] { return robot_.services("robot/eye")->at(0).missed == two.missed(); };
  EXPECT_TRUE(eventually(is_told));
  said = testing::internal::GetCapturedStderr();
  unsetenv("GIMNET_LOG");
  EXPECT_NE(said.find(": robot/eye: "), std::string::npos) << said;
  EXPECT_NE(said.find(" messages were missed so far\n"), std::string::npos) << said;
}

TEST_F(Wishes, OneThatIsNotTakenHoldsNoOtherOfThatServiceUp) {
  offer(Delivery::sync, 1);
  const Subscription idle = subscribe({});
  publish(1);
  EXPECT_TRUE(eventually([&] { return idle.queue().received() == 1; }));
  {
    const Subscription other = subscribe({});
    EXPECT_EQ(idle.receive(kWait)->text(), "1");
    for (int i = 2; i <= 4; ++i) {
      publish(i);
      EXPECT_EQ(other.receive(kWait)->text(), std::to_string(i));
    }
  }
  EXPECT_EQ(idle.queue().size(), 3u);
  for (int i = 2; i <= 4; ++i) EXPECT_EQ(idle.receive(kWait)->text(), std::to_string(i));
  pass_the_hub();  // it has heard that they were taken: the next one takes nobody's place
  publish(5);
  publish(6);
  pass_the_hub();
  EXPECT_EQ(idle.queue().size(), 1u) << "the window holds again";
  EXPECT_EQ(idle.receive(kWait)->text(), "5");
  EXPECT_EQ(idle.receive(kWait)->text(), "6");
}

TEST_F(Wishes, TheLastMessageIsForEachThatSubscribesLaterAndForNobodyTwice) {
  publisher_ = robot_.advertise("eye", {.retain = true}).or_throw();
  publish(1);
  const Subscription first = subscribe({});
  EXPECT_EQ(first.receive(kWait)->text(), "1");
  const Subscription second = subscribe({});
  EXPECT_EQ(second.receive(kWait)->text(), "1");
  publish(2);
  EXPECT_EQ(second.receive(kWait)->text(), "2");
  EXPECT_EQ(first.receive(kWait)->text(), "2") << "the first message came once";
  EXPECT_EQ(first.missed() + second.missed(), 0u);
}

TEST_F(Wishes, OneWithAnAgeLimitTellsTheAgeOfItsMessages) {
  publisher_ = robot_.advertise("eye", {.age_ms_max = UINT32_MAX}).or_throw();
  const Subscription seen = subscribe({});
  const auto is_measured = [](const Node& node) { return node.state().hub_round_trip_ns != 0; };
  ASSERT_TRUE(eventually([&] { return is_measured(robot_) && is_measured(viewer_); }));
  publish(1);
  const std::int64_t published_ns = wall_now_ns();
  const Message message = seen.receive(kWait).or_throw();
  const std::int64_t before_ns = wall_now_ns();
  const auto age = message.age();
  const std::int64_t after_ns = wall_now_ns();
  ASSERT_TRUE(age);
  EXPECT_GT(age->error_ns, 0);
  // Both ends have the clock of this machine, and know the hub's to half of a round trip.
  const std::int64_t error_ns = age->error_ns + robot_.state().hub_round_trip_ns;
  EXPECT_GE(age->age_ns, before_ns - published_ns - error_ns);
  EXPECT_LE(age->age_ns, after_ns - *message.sent_ns() + error_ns);
}

TEST_F(Wishes, OfANodeThatEndedNobodyWaitsForSubscribers) {
  Node camera("camera", hub_.url());
  const Publisher pictures = camera.advertise("pictures").or_throw();
  pictures.wait_for_subscribers(0).or_throw();
  camera.close();
  EXPECT_TRUE(pictures.wait_for_subscribers(0).is(Status::closed)) << "a loop over it ends";
}

class PublishedServices : public gimi::test::Conversation {};

TEST_F(PublishedServices, SayTheLongestAgeOfTheirMessages) {
  std::optional<Publisher> odometry;
  std::thread asking(
      [&] { odometry.emplace(node_->advertise("odom", {.age_ms_max = 250}).or_throw()); });
  std::uint16_t number = 0;
  ASSERT_TRUE(hub_.next_request<proto::ns::Advertise>(number));
  const proto::ns::AdvertiseAnswer answer{GroupId{(7u << 20) | 11}, 1};
  hub_.send_control(proto::Kind::ns, proto::encode_answer(answer, number));
  asking.join();
  odometry->publish("x", kForever).or_throw();
  const auto frame = hub_.next_message();
  ASSERT_TRUE(frame);
  const auto age = proto::find_age(frame->view().extensions);
  ASSERT_TRUE(age);
  EXPECT_EQ(age->longest_ms, 250u);
  hub_.close();
  node_->close();
}

}  // namespace
}  // namespace gimnet
