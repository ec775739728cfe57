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
  odometry.publish("pose").or_throw();
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

TEST_F(Services, ASubscriptionMayComeFirst) {
  const Node viewer = join();
  const Subscription odometry = viewer.subscribe("robot/odom").or_throw();
  EXPECT_FALSE(odometry.exists());
  EXPECT_TRUE(odometry.wait_until_exists(Timeout{1}).is(Status::timeout));
  const Node robot = join("robot");
  const Publisher publisher = robot.advertise("odom").or_throw();
  odometry.wait_until_exists(kWait).or_throw();
  publisher.wait_for_subscribers(1, kWait).or_throw();
  publisher.publish("pose").or_throw();
  EXPECT_EQ(odometry.receive(kWait)->text(), "pose");
}

TEST_F(Services, ASubscriptionSurvivesItsProvider) {
  const Node viewer = join();
  const Subscription odometry = viewer.subscribe("robot/odom").or_throw();
  for (const char* text : {"first life", "second life"}) {
    const Node robot = join("robot");
    const Publisher publisher = robot.advertise("odom").or_throw();
    publisher.wait_for_subscribers(1, kWait).or_throw();
    publisher.publish(text).or_throw();
    EXPECT_EQ(odometry.receive(kWait)->text(), text);
  }
  EXPECT_TRUE(eventually([&] { return !odometry.exists(); }));
}

TEST_F(Services, WhatWasPublishedBeforeLeavingStillComes) {
  const Node viewer = join();
  const Subscription odometry = viewer.subscribe("robot/odom", {1000, AtFullQueue::overwrite_oldest}).or_throw();
  {
    const Node robot = join("robot");
    const Publisher publisher = robot.advertise("odom").or_throw();
    publisher.wait_for_subscribers(1, kWait).or_throw();
    for (int i = 0; i < 500; ++i) publisher.publish(std::to_string(i)).or_throw();
    robot.drain(kWait).or_throw();
  }
  for (int i = 0; i < 500; ++i) ASSERT_EQ(odometry.receive(kWait)->text(), std::to_string(i));
}

TEST_F(Services, EndWithTheirLastHandle) {
  const Node robot = join("robot");
  const Node viewer = join();
  std::optional<Publisher> publisher = robot.advertise("odom").or_throw();
  std::optional<Publisher> copy = publisher;
  std::optional<Subscription> subscription = viewer.subscribe("robot/odom").or_throw();
  const std::optional<Subscription> same = viewer.subscribe("robot/odom").or_throw();
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
  publisher.publish("to nobody").or_throw();
  const Subscription again = viewer.subscribe("robot/odom").or_throw();
  publisher.wait_for_subscribers(1, kWait).or_throw();
  publisher.publish("to somebody").or_throw();
  EXPECT_EQ(again.receive(kWait)->text(), "to somebody");
  EXPECT_EQ(publisher.published(), 2u);
}

TEST_F(Services, AreRefusedWithWords) {
  const Node robot = join("robot");
  const Publisher publisher = robot.advertise("odom").or_throw();
  const auto again = robot.advertise("odom");
  EXPECT_TRUE(again.is(Status::taken));
  EXPECT_NE(again.failure().sentence.find("robot/odom"), std::string::npos);
  EXPECT_TRUE(robot.advertise("no spaces").is(Status::bad_name));
  EXPECT_TRUE(join().advertise("odom").is(Status::denied));
  EXPECT_TRUE(robot.subscribe("").is(Status::bad_name));
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
      for (int n = 0; n < 50; ++n) publisher.publish(name).or_throw();
      for (int n = 0; n < 50; ++n) EXPECT_EQ(subscription.receive(kWait)->text(), name);
    });
  }
  for (std::thread& thread : threads) thread.join();
}

}  // namespace
}  // namespace gimnet
