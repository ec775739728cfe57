#include "client/gimi/watch_queues.hpp"

#include <gtest/gtest.h>

#include <map>
#include <optional>
#include <set>
#include <thread>

#include "proto/control/ns_watch.hpp"
#include "tests/client/gimi/support/conversation.hpp"
#include "tests/client/gimi/support/hub_process.hpp"

namespace gimnet {
namespace {

using test::eventually;
using test::HubProcess;
using test::kPatience;

constexpr Timeout kWait = std::chrono::duration_cast<Timeout>(kPatience);

class WatchTableTest : public testing::Test {
 protected:
  [[nodiscard]] Node join(const std::string& name = {}) { return Node(name, hub_.url()); }
  /// The next event, as "kind name".
  static std::string next(const Watch& watch) {
    const auto event = watch.receive(kWait);
    if (!event) return "nothing: " + event.failure().sentence;
    std::string text(change_text(event->change));
    if (event->node) text += " " + event->node->name;
    if (event->service) text += " " + event->service->name;
    if (!event->former_name.empty()) text += " from " + event->former_name;
    return text;
  }
  HubProcess hub_{{"--shards", "2"}};
};

TEST_F(WatchTableTest, TellsWhatIsThereAndWhatChanges) {
  const Node viewer = join("viewer");
  const Node robot = join("hall/robot");
  const Publisher odometry = robot.advertise("odom").or_throw();
  const Watch watch = viewer.watch("hall/**").or_throw();
  EXPECT_EQ(next(watch), "snapshot begins");
  EXPECT_EQ(next(watch), "present hall/robot");
  EXPECT_EQ(next(watch), "present hall/robot/odom");
  EXPECT_EQ(next(watch), "snapshot ends");
  {
    const Node late = join("hall/late");
    EXPECT_EQ(next(watch), "joined hall/late");
  }
  EXPECT_EQ(next(watch), "left hall/late");
  EXPECT_FALSE(watch.try_receive());
}

TEST_F(WatchTableTest, AServiceFollowsTheNewNameOfItsNode) {
  const Node viewer = join("viewer");
  const Node robot = join("robot");
  const Publisher odometry = robot.advertise("odom").or_throw();
  const Subscription old_name = viewer.subscribe("robot/odom").or_throw();
  const Subscription new_name = viewer.subscribe("forklift/odom").or_throw();
  odometry.wait_for_subscribers(1, kWait).or_throw();
  const Watch watch = viewer.watch("**").or_throw();
  while (next(watch) != "snapshot ends") {
  }
  robot.take_name("forklift", kWait).or_throw();
  EXPECT_EQ(robot.state().name, "forklift");
  EXPECT_EQ(odometry.name(), "forklift/odom");
  std::multiset<std::string> told;
  for (int i = 0; i < 3; ++i) told.insert(next(watch));
  EXPECT_EQ(told, (std::multiset<std::string>{"withdrawn robot/odom", "renamed forklift from robot",
                                              "advertised forklift/odom"}));
  new_name.wait_until_exists(kWait).or_throw();
  // The provider learns the new group id a moment after everybody else; what it sends until then
  // reaches nobody.
  EXPECT_TRUE(eventually([&] {
    odometry.publish("under the new name", kForever).or_throw();
    return new_name.try_receive().has_value();
  }));
  EXPECT_FALSE(old_name.exists());
  robot.give_name_back(kWait).or_throw();
  EXPECT_EQ(robot.state().name, "");
  EXPECT_EQ(odometry.name(), "odom") << "until the node has a name again";
  EXPECT_TRUE(viewer.find("forklift").is(Status::not_found));
}

TEST_F(WatchTableTest, ANameThatIsHeldIsRefused) {
  const Node viewer = join("viewer");
  const Node robot = join("robot");
  const auto taken = robot.take_name("viewer", kWait);
  EXPECT_TRUE(taken.is(Status::taken));
  EXPECT_NE(taken.failure().sentence.find(viewer.peer().text()), std::string::npos)
      << taken.failure().sentence;
  EXPECT_TRUE(robot.take_name("a//b", kWait).is(Status::bad_name));
  EXPECT_TRUE(robot.take_name("7.1", kWait).is(Status::bad_name))
      << "who sends there would reach somebody else";
  EXPECT_EQ(robot.state().name, "robot");
}

TEST_F(WatchTableTest, SaysWhatIsWrong) {
  const Node viewer = join("viewer");
  EXPECT_TRUE(viewer.watch("a//b").is(Status::bad_name));
  EXPECT_TRUE(viewer.watch("", {.nodes = false, .services = false}).is(Status::bad_argument));
}

/// A watch that is not read tells later all that it has to; it holds up neither messages nor the
/// other watch.
TEST_F(WatchTableTest, OneThatIsNotReadHoldsUpNothingElse) {
  const Node viewer = join("viewer");
  const Watch idle = viewer.watch("**").or_throw();
  const Watch busy = viewer.watch("*").or_throw();
  while (next(busy) != "snapshot ends") {
  }
  const Node sender = join("sender");
  EXPECT_EQ(next(busy), "joined sender");
  for (int i = 0; i < 100; ++i) {
    Node robot = join("robot-" + std::to_string(i));
    EXPECT_EQ(next(busy), "joined robot-" + std::to_string(i));
    sender.send(sender.find("viewer").or_throw(), "x").or_throw();
    EXPECT_TRUE(viewer.receive(kWait));
    robot.close();
    EXPECT_EQ(next(busy), "left robot-" + std::to_string(i));
  }
  std::map<std::string, int> late;
  for (std::string text = next(idle); text != "left robot-99"; text = next(idle)) ++late[text];
  EXPECT_EQ(late["joined robot-50"], 1);
}

}  // namespace
}  // namespace gimnet

namespace gimnet::gimi {
namespace {

namespace ns = proto::ns;

/// Tests the acknowledgements of a watch, as they are seen on the wire.
class WatchTaken : public test::Conversation {
 protected:
  void SetUp() override {
    std::thread asking([&] { watch_.emplace(node_->watch("**").or_throw()); });
    std::uint16_t number = 0;
    const auto request = hub_.next_request<ns::Watch>(number);
    ASSERT_TRUE(request);
    number_ = request->watch;
    tell(2);  // before the answer: it is held back until the program has its handle
    hub_.send_control(proto::Kind::ns, proto::encode_answer(ns::WatchAnswer{true}, number));
    asking.join();
  }

  /// One frame with so many changes.
  void tell(std::size_t changes) {
    ns::WatchEvents events;
    events.watch = number_;
    events.epoch = 5;
    events.changes.resize(changes);
    events.changes.back().kind = ns::ChangeKind::end;
    hub_.send_control(proto::Kind::ns, proto::encode(events));
  }

  /// The next frame is a message that the node sends now: it acknowledged nothing before.
  void expect_nothing_acknowledged() {
    node_->send(Peer{test::kPeerId}, "next").or_throw();
    EXPECT_EQ(next().data, "next");
  }
  void expect_acknowledged() {
    std::uint16_t number = 0;
    const auto taken = hub_.next_request<ns::WatchTaken>(number);
    ASSERT_TRUE(taken);
    EXPECT_EQ(taken->watch, number_);
    EXPECT_EQ(taken->frames, 1u);
    EXPECT_NE(number, 0u) << "it counts among what the hub has not answered";
  }

  std::optional<Watch> watch_;
  std::uint32_t number_ = 0;
};

TEST_F(WatchTaken, AFrameIsAcknowledgedWhenItsLastEventWasTaken) {
  expect_nothing_acknowledged();
  EXPECT_EQ(watch_->receive(kForever)->change, Change::snapshot_begins);
  expect_nothing_acknowledged();
  EXPECT_EQ(watch_->receive(kForever)->change, Change::snapshot_ends);
  expect_acknowledged();
  EXPECT_FALSE(watch_->try_receive());
  expect_nothing_acknowledged();
}

TEST_F(WatchTaken, EachFrameByItself) {
  for (int i = 0; i < 2; ++i) EXPECT_TRUE(watch_->receive(kForever));
  expect_acknowledged();
  tell(1);
  tell(3);
  EXPECT_TRUE(watch_->receive(kForever));
  expect_acknowledged();
  for (int i = 0; i < 2; ++i) EXPECT_TRUE(watch_->receive(kForever));
  expect_nothing_acknowledged();
  EXPECT_TRUE(watch_->receive(kForever));
  expect_acknowledged();
}

}  // namespace
}  // namespace gimnet::gimi
