#include "client/gimi/watch_table.hpp"

#include <gtest/gtest.h>

#include <map>
#include <set>

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
  std::multiset<std::string> told;
  for (int i = 0; i < 3; ++i) told.insert(next(watch));
  EXPECT_EQ(told, (std::multiset<std::string>{"withdrawn robot/odom", "renamed forklift from robot",
                                              "advertised forklift/odom"}));
  new_name.wait_until_exists(kWait).or_throw();
  // The provider learns the new group id a moment after everybody else; what it sends until then reaches nobody.
  EXPECT_TRUE(eventually([&] {
    odometry.publish("under the new name").or_throw();
    return new_name.try_receive().has_value();
  }));
  EXPECT_FALSE(old_name.exists());
  robot.give_name_back(kWait).or_throw();
  EXPECT_EQ(robot.state().name, "");
  EXPECT_TRUE(viewer.find("forklift").is(Status::not_found));
}

TEST_F(WatchTableTest, ANameThatIsHeldIsRefused) {
  const Node viewer = join("viewer");
  const Node robot = join("robot");
  const auto taken = robot.take_name("viewer", kWait);
  EXPECT_TRUE(taken.is(Status::taken));
  EXPECT_NE(taken.failure().sentence.find(viewer.peer().text()), std::string::npos) << taken.failure().sentence;
  EXPECT_TRUE(robot.take_name("a//b", kWait).is(Status::bad_name));
  EXPECT_EQ(robot.state().name, "robot");
}

TEST_F(WatchTableTest, SaysWhatIsWrong) {
  const Node viewer = join("viewer");
  EXPECT_TRUE(viewer.watch("a//b").is(Status::bad_name));
  EXPECT_TRUE(viewer.watch("", {.nodes = false, .services = false}).is(Status::bad_argument));
}

/// A watch that is not read tells later all that it has to; it holds up neither messages nor the other watch.
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
    sender.send("viewer", "x").or_throw();
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
