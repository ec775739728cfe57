#include "client/gimi/service_table.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <thread>

#include "gimnet/gimi.hpp"
#include "tests/client/gimi/support/hub_process.hpp"

namespace gimnet {
namespace {

using test::eventually;
using test::HubProcess;

constexpr Timeout kWait = std::chrono::duration_cast<Timeout>(test::kPatience);

class Services : public testing::Test {
 protected:
  [[nodiscard]] Node join(const std::string& name = {}) { return Node(name, hub_.url()); }
  HubProcess hub_;
};

TEST_F(Services, WhatIsPublishedComesToAllSubscribers) {
  const Node robot = join("robot");
  const Node first = join();
  const Node second = join();
  const Publisher odometry = robot.advertise("odom").or_throw();
  EXPECT_EQ(odometry.name(), "robot/odom");
  const Subscription one = first.subscribe("robot/odom").or_throw();
  const Subscription two = second.subscribe("robot/odom").or_throw();
  odometry.wait_for_subscribers(2, kWait).or_throw();
  odometry.publish("pose", kForever).or_throw();
  for (const Subscription& subscription : {one, two}) {
    const auto message = subscription.receive(kWait);
    ASSERT_TRUE(message);
    EXPECT_EQ(message->text(), "pose");
    EXPECT_EQ(message->service(), "robot/odom");
    EXPECT_EQ(message->from(), robot.peer());
    EXPECT_TRUE(message->sent_ns());
    EXPECT_EQ(subscription.missed(), 0u);
  }
}

TEST_F(Services, TheLatestWaitsAloneUnlessTheProgramChoseALength) {
  const Node robot = join("robot");
  const Node viewer = join();
  const Node recorder = join();
  PublishOptions options;
  options.delivery = Delivery::latest;
  const Subscription before = recorder.subscribe("robot/image").or_throw();
  const Publisher images = robot.advertise("image", options).or_throw();
  const Subscription newest = viewer.subscribe("robot/image").or_throw();
  const Node archive = join();
  const Subscription all = archive.subscribe("robot/image", {.queue = 64}).or_throw();
  images.wait_for_subscribers(3, kWait).or_throw();
  // One at a time: what is under way the hub may replace, too.
  for (const std::string text : {"1", "2", "3"}) {
    images.publish(text, kForever).or_throw();
    EXPECT_TRUE(eventually([&] { return all.queue().received() == std::stoul(text); }));
    EXPECT_TRUE(eventually([&] { return newest.queue().received() == std::stoul(text); }));
    EXPECT_TRUE(eventually([&] { return before.queue().received() == std::stoul(text); }));
  }
  for (const Subscription& one : {newest, before}) {
    const auto message = one.receive(kWait);
    ASSERT_TRUE(message);
    EXPECT_EQ(message->text(), "3");
    EXPECT_TRUE(message->latest());
    EXPECT_FALSE(one.try_receive());
    EXPECT_EQ(one.missed(), 2u) << "they were skipped";
  }
  for (const char* text : {"1", "2", "3"}) EXPECT_EQ(all.receive(kWait)->text(), text);
  EXPECT_EQ(all.missed(), 0u);
}

TEST(RetainedServices, PublishSaysWhatIsNotKeptForLaterSubscribers) {
  const HubProcess hub(
      {"--limit", "retained_message_bytes=30000", "--limit", "retained_budget_bytes=70000"});
  const Node robot("robot", hub.url());
  const Node viewer("", hub.url());
  PublishOptions options;
  options.retain = true;
  const Publisher map = robot.advertise("map", options).or_throw();
  const Subscription early = viewer.subscribe("robot/map").or_throw();
  map.wait_for_subscribers(1, kWait).or_throw();
  const std::string largest(30'000, 'x');
  map.publish(largest, kWait).or_throw();
  EXPECT_EQ(early.receive(kWait).or_throw().size(), largest.size());
  robot.drain(kWait).or_throw();
  EXPECT_TRUE(map.retained());
  const auto beyond = map.publish(largest + "x", kWait);
  EXPECT_TRUE(beyond.is(Status::not_retained)) << "one byte beyond";
  EXPECT_NE(beyond.failure().sentence.find("robot/map was published, but"), std::string::npos)
      << beyond.failure().sentence;
  EXPECT_NE(beyond.failure().sentence.find("30000 bytes and less"), std::string::npos);
  EXPECT_EQ(early.receive(kWait).or_throw().size(), largest.size() + 1) << "it was published";
  EXPECT_EQ(map.published(), 2u);
  EXPECT_TRUE(map.retained().is(Status::not_retained));
  map.publish("small", kWait).or_throw();
  EXPECT_TRUE(map.retained());
}

TEST(RetainedServices, AHubWithoutRoomTellsTheProviderOfEachService) {
  const HubProcess hub(
      {"--limit", "retained_message_bytes=30000", "--limit", "retained_budget_bytes=70000"});
  const Node robot("robot", hub.url());
  PublishOptions options;
  options.retain = true;
  const Publisher map = robot.advertise("map", options).or_throw();
  const Publisher plan = robot.advertise("plan", options).or_throw();
  const Publisher route = robot.advertise("route", options).or_throw();
  map.publish(std::string(30'000, 'm'), kWait).or_throw();
  // One node has half of the budget: 5,000 bytes are left.
  plan.publish(std::string(5'001, 'p'), kWait).or_throw();
  route.publish(std::string(20'000, 'r'), kWait).or_throw();
  EXPECT_TRUE(eventually([&] { return plan.retained().is(Status::not_retained); }));
  EXPECT_TRUE(eventually([&] { return route.retained().is(Status::not_retained); }));
  EXPECT_NE(plan.retained().failure().sentence.find("robot/plan"), std::string::npos);
  EXPECT_TRUE(map.retained());
  plan.publish(std::string(5'000, 'p'), kWait).or_throw();
  robot.drain(kWait).or_throw();
  EXPECT_TRUE(plan.retained());
  const Node viewer("", hub.url());
  EXPECT_EQ(viewer.subscribe("robot/plan").or_throw().receive(kWait).or_throw().size(), 5'000u);
}

TEST_F(Services, ASubscriptionMayComeFirst) {
  const Node viewer = join();
  const Subscription odometry = viewer.subscribe("robot/odom").or_throw();
  EXPECT_FALSE(odometry.exists());
  EXPECT_TRUE(odometry.wait_until_exists(Timeout{1}).is(Status::timeout));
  const Node robot = join("robot");
  const Publisher publisher = robot.advertise("odom").or_throw();
  odometry.wait_until_exists(kWait).or_throw();
  publisher.wait_for_subscribers(1, kWait).or_throw();
  publisher.publish("pose", kForever).or_throw();
  EXPECT_EQ(odometry.receive(kWait)->text(), "pose");
}

TEST_F(Services, ASubscriptionSurvivesItsProvider) {
  const Node viewer = join();
  const Subscription odometry = viewer.subscribe("robot/odom").or_throw();
  for (const char* text : {"first life", "second life"}) {
    const Node robot = join("robot");
    const Publisher publisher = robot.advertise("odom").or_throw();
    publisher.wait_for_subscribers(1, kWait).or_throw();
    publisher.publish(text, kForever).or_throw();
    EXPECT_EQ(odometry.receive(kWait)->text(), text);
  }
  EXPECT_TRUE(eventually([&] { return !odometry.exists(); }));
}

TEST_F(Services, WhatWasPublishedBeforeLeavingStillComes) {
  const Node viewer = join();
  const Subscription odometry = viewer.subscribe("robot/odom", {.queue = 1000}).or_throw();
  {
    const Node robot = join("robot");
    const Publisher publisher = robot.advertise("odom").or_throw();
    publisher.wait_for_subscribers(1, kWait).or_throw();
    for (int i = 0; i < 500; ++i) publisher.publish(std::to_string(i), kForever).or_throw();
    robot.drain(kWait).or_throw();
  }
  for (int i = 0; i < 500; ++i) ASSERT_EQ(odometry.receive(kWait)->text(), std::to_string(i));
}

TEST_F(Services, EndWithTheirLastHandle) {
  const Node robot = join("robot");
  const Node viewer = join();
  std::optional<Publisher> publisher = robot.advertise("odom").or_throw();
  std::optional<Publisher> copy(*publisher);
  std::optional<Subscription> subscription = viewer.subscribe("robot/odom").or_throw();
  const Subscription other = viewer.subscribe("robot/odom").or_throw();
  publisher->wait_for_subscribers(1, kWait).or_throw();
  publisher.reset();
  subscription.reset();
  EXPECT_EQ(viewer.services("robot/*").or_throw().at(0).subscribers, 1u);
  copy.reset();
  EXPECT_TRUE(viewer.services("robot/*").or_throw().empty());
  EXPECT_TRUE(robot.advertise("odom")) << "the name is free again";
}

TEST_F(Services, UnsubscribingEndsTheMessages) {
  const Node robot = join("robot");
  const Node viewer = join();
  const Publisher publisher = robot.advertise("odom").or_throw();
  {
    const Subscription subscription = viewer.subscribe("robot/odom").or_throw();
    publisher.wait_for_subscribers(1, kWait).or_throw();
  }
  EXPECT_TRUE(eventually([&] { return publisher.subscribers() == 0; }));
  publisher.publish("to nobody", kForever).or_throw();
  const Subscription again = viewer.subscribe("robot/odom").or_throw();
  publisher.wait_for_subscribers(1, kWait).or_throw();
  publisher.publish("to somebody", kForever).or_throw();
  EXPECT_EQ(again.receive(kWait)->text(), "to somebody");
  EXPECT_EQ(publisher.published(), 2u);
}

SendOptions synchronized(std::size_t window) {
  SendOptions options;
  options.window = window;
  return options;
}

AcceptOptions accepting(MessageKey key) {
  AcceptOptions options;
  options.key = key;
  options.queue = {1000, AtFullQueue::stop_reading};
  return options;
}

TEST_F(Services, EveryNodeSendsToWhoAcceptsAndIsAnswered) {
  const Node robot = join("robot");
  const Queue commands = robot.accept("drive", accepting({5, 2})).or_throw();
  const Node named = join("operator");
  const Node nameless = join();
  for (const Node* node : {&named, &nameless}) {
    const Sender drive = node->sender("robot/drive", synchronized(3)).or_throw();
    EXPECT_EQ(drive.service(), "robot/drive");
    for (int i = 0; i < 100; ++i) drive.send(std::to_string(i)).or_throw();
    drive.settle(kWait).or_throw();
    EXPECT_EQ(drive.counts().acknowledged, 100u);
    for (int i = 0; i < 100; ++i) {
      const auto command = commands.receive(kWait);
      ASSERT_TRUE(command);
      EXPECT_EQ(command->text(), std::to_string(i));
      EXPECT_EQ(command->from(), node->peer());
      EXPECT_EQ(command->key(), (MessageKey{5, 2}));
    }
  }
}

TEST_F(Services, WhatIsSentToOneAndToItsNodeAreTwoStreams) {
  const Node robot = join("robot");
  const Queue commands = robot.accept("drive", accepting({5, 0})).or_throw();
  const Node viewer = join();
  SendOptions options = synchronized(1);
  options.key = {5, 0};
  const Sender drive = viewer.sender("robot/drive", options).or_throw();
  const Sender direct = viewer.sender(robot.peer(), options).or_throw();
  for (int i = 0; i < 50; ++i) {
    drive.send("service").or_throw();
    direct.send("node").or_throw();
  }
  drive.settle(kWait).or_throw();
  direct.settle(kWait).or_throw();
  EXPECT_EQ(commands.received(), 50u);
  EXPECT_EQ(robot.queue({5, 0}).received(), 50u);
}

TEST_F(Services, OnlyWhatAcceptsCanBeSentTo) {
  const Node robot = join("robot");
  const Publisher odometry = robot.advertise("odom").or_throw();
  const Node viewer = join();
  EXPECT_TRUE(viewer.sender("robot/odom").is(Status::not_found));
  EXPECT_TRUE(viewer.sender("robot/drive").is(Status::not_found)) << "not there yet";
  EXPECT_TRUE(viewer.sender("robot/*").is(Status::not_found)) << "one service, not a pattern";
  EXPECT_TRUE(viewer.sender("a//b").is(Status::bad_name));
  EXPECT_TRUE(viewer.sender("robot/odom", synchronized(kWindowMax + 1)).is(Status::not_found));
}

TEST_F(Services, ASenderFollowsAServiceThatGoesAndComesBack) {
  const Node viewer = join();
  std::optional<Sender> drive;
  for (const std::uint32_t life : {1u, 2u, 3u}) {
    const Node robot = join("robot");
    // Each life has other types of messages, so each has another group.
    const Queue commands = robot.accept("drive", accepting({life, 0})).or_throw();
    if (!drive) drive = viewer.sender("robot/drive", synchronized(1)).or_throw();
    EXPECT_TRUE(eventually([&] { return drive->send(std::to_string(life), kWait).ok(); }));
    drive->settle(kWait).or_throw();
    EXPECT_EQ(commands.receive(kWait)->text(), std::to_string(life));
    EXPECT_EQ(drive->counts().acknowledged, life);
    // A message that waits for its answer when the service goes is lost, not waited for.
  }
  EXPECT_TRUE(eventually([&] { return drive->send("?", kWait).is(Status::not_found); }));
  EXPECT_NE(drive->send("?").failure().sentence.find("robot/drive"), std::string::npos);
}

TEST_F(Services, ASenderFollowsAServiceToItsNodesNewName) {
  const Node viewer = join();
  const Node robot = join("robot");
  const Queue commands = robot.accept("drive", accepting({5, 0})).or_throw();
  const Sender drive = viewer.sender("robot/drive", synchronized(1)).or_throw();
  drive.send("1").or_throw();
  drive.settle(kWait).or_throw();
  robot.take_name("forklift", kWait).or_throw();
  EXPECT_TRUE(eventually([&] { return drive.send("?", kWait).is(Status::not_found); }))
      << "another service now";
  EXPECT_TRUE(eventually([&] { return viewer.sender("forklift/drive").ok(); }));
  viewer.sender("forklift/drive").or_throw().send("2").or_throw();
  robot.take_name("robot", kWait).or_throw();
  EXPECT_TRUE(eventually([&] { return drive.send("3", kWait).ok(); }));
  std::string last;
  while (last != "3") last = commands.receive(kWait).or_throw().text();
}

TEST_F(Services, ReadingAndSendingToOneServiceDoNotDisturbEachOther) {
  const Node viewer = join();
  const Node robot = join("robot");
  std::optional<Subscription> subscription = viewer.subscribe("robot/drive").or_throw();
  const Queue commands = robot.accept("drive", accepting({5, 0})).or_throw();
  const Sender drive = viewer.sender("robot/drive", synchronized(1)).or_throw();
  subscription.reset();
  drive.send("1").or_throw();
  drive.settle(kWait).or_throw();
  EXPECT_EQ(viewer.services("robot/drive").or_throw().at(0).subscribers, 1u) << "it is followed";
  EXPECT_TRUE(viewer.subscribe("robot/drive").is(Status::not_found));
  EXPECT_EQ(viewer.services("robot/drive").or_throw().at(0).subscribers, 1u) << "it still is";
  drive.send("2").or_throw();
  drive.settle(kWait).or_throw();
}

TEST_F(Services, OnlyWhatGivesDataCanBeSubscribed) {
  const Node viewer = join();
  const Subscription early = viewer.subscribe("robot/drive").or_throw();
  std::optional<Node> robot = join("robot");
  const Accepted taking = robot->accept("drive", accepting({5, 0})).or_throw();
  EXPECT_TRUE(eventually([&] { return early.accepts(); }));
  EXPECT_FALSE(early.exists());
  const auto waited = early.wait_until_exists(Timeout{1});
  ASSERT_TRUE(waited.is(Status::timeout));
  EXPECT_EQ(waited.failure().sentence, "robot/drive takes data and gives none; send to it");
  const Node late = join();
  const auto refused = late.subscribe("robot/drive");
  ASSERT_TRUE(refused.is(Status::not_found));
  EXPECT_EQ(refused.failure().sentence,
            "cannot subscribe to 'robot/drive': it takes data and gives none; send to it");
  {
    const Answers answers = robot->answer("add").or_throw();
    EXPECT_EQ(late.subscribe("robot/add").failure().sentence,
              "cannot subscribe to 'robot/add': it answers questions and gives no data; ask it by "
              "request()");
  }
  EXPECT_TRUE(
      eventually([&] { return viewer.services("robot/drive").or_throw().at(0).subscribers == 1; }));
  // It may become one that provides.
  robot.reset();
  robot = join("robot");
  const Publisher drive = robot->advertise("drive").or_throw();
  early.wait_until_exists(kWait).or_throw();
  EXPECT_FALSE(early.accepts());
  drive.wait_for_subscribers(1, kWait).or_throw();
  drive.publish("gives", kForever).or_throw();
  EXPECT_EQ(early.receive(kWait)->text(), "gives");
}

TEST_F(Services, AreRefusedWithWords) {
  const Node robot = join("robot");
  const Publisher publisher = robot.advertise("odom").or_throw();
  const auto again = robot.advertise("odom");
  EXPECT_TRUE(again.is(Status::taken));
  EXPECT_NE(again.failure().sentence.find("robot/odom"), std::string::npos);
  EXPECT_TRUE(robot.advertise("no spaces").is(Status::bad_name));
  EXPECT_EQ(robot.accept("a/b").failure().sentence,
            "cannot offer 'a/b': a service's name has one part");
  EXPECT_TRUE(join().advertise("odom").is(Status::denied));
  EXPECT_TRUE(robot.subscribe("").is(Status::bad_name));
}

TEST_F(Services, AreSubscribedByFullNamesOnly) {
  const Node viewer = join();
  const auto one_part = viewer.subscribe("odom");
  EXPECT_TRUE(one_part.is(Status::bad_name));
  EXPECT_EQ(one_part.failure().sentence,
            "cannot subscribe to 'odom': it is no full name of a service: write NODE/SERVICE");
  const auto pattern = viewer.subscribe("robot/*");
  EXPECT_TRUE(pattern.is(Status::bad_name));
  EXPECT_NE(pattern.failure().sentence.find("watch"), std::string::npos);
}

TEST_F(Services, ManyThreadsSubscribeAndPublish) {
  const Node robot = join("robot");
  const Node viewer = join();
  std::vector<std::thread> threads;
  for (int i = 0; i < 8; ++i) {
    threads.emplace_back([&, name = "s" + std::to_string(i)] {
      const Publisher publisher = robot.advertise(name).or_throw();
      const Subscription subscription = viewer.subscribe("robot/" + name).or_throw();
      publisher.wait_for_subscribers(1, kWait).or_throw();
      for (int n = 0; n < 50; ++n) publisher.publish(name, kForever).or_throw();
      for (int n = 0; n < 50; ++n) EXPECT_EQ(subscription.receive(kWait)->text(), name);
    });
  }
  for (std::thread& thread : threads) thread.join();
}

}  // namespace
}  // namespace gimnet
