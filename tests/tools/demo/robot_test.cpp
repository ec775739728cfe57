#include "tools/demo/robot.hpp"

#include <gtest/gtest.h>

#include "tests/tools/demo/fake_network.hpp"
#include "tools/demo/simulated_robot.hpp"

namespace gimnet::demo {
namespace {

std::unique_ptr<RobotSource> simulated(std::int64_t now_ns) {
  return std::make_unique<SimulatedRobot>(WorldMap::hall(), now_ns);
}

// Steps until the condition holds; a step takes as long as the robot waits.
template <class Condition>
testing::AssertionResult run_until(Robot& robot, Condition condition) {
  for (int step = 0; step < 10'000; ++step) {
    if (const std::optional<Error> error = robot.step())
      return testing::AssertionFailure() << error->sentence;
    if (condition()) return testing::AssertionSuccess();
  }
  return testing::AssertionFailure() << "never";
}

std::size_t count(const FakeNetwork& network, Service service) {
  std::size_t number = 0;
  for (const NodePort::Event& event : network.to_viewer) number += event.service == service ? 1 : 0;
  return number;
}

void tell(FakeNetwork& network, const DriveCommand& command) {
  (void)network.viewer.command(encode(command));
}

TEST(Robot, SaysNothingToNobody) {
  FakeNetwork network;
  network.heard = false;
  Robot robot(network.robot, simulated);
  for (int step = 0; step < 100; ++step) ASSERT_FALSE(robot.step());
  EXPECT_TRUE(network.to_viewer.empty());
  network.heard = true;
  ASSERT_FALSE(robot.step());
  ASSERT_FALSE(network.to_viewer.empty());
  EXPECT_EQ(network.to_viewer.front().service, Service::kInfo);
}

TEST(Robot, PublishesOdometryAndScans) {
  FakeNetwork network;
  Robot robot(network.robot, simulated);
  ASSERT_TRUE(run_until(robot, [&] { return count(network, Service::kScan) == 1; }));
  EXPECT_EQ(count(network, Service::kOdometry), 4U);
  const std::optional<Scan> scan = decode<Scan>(network.to_viewer.back().payload);
  ASSERT_TRUE(scan);
  EXPECT_EQ(scan->stamp.number, 1U);
  EXPECT_EQ(scan->stamp.made_ns, network.now_ns);
}

TEST(Robot, FinishesWhenToldWithItsTotals) {
  FakeNetwork network;
  Robot robot(network.robot, simulated);
  ASSERT_TRUE(run_until(robot, [&] { return count(network, Service::kOdometry) == 2; }));
  DriveCommand command;
  command.stamp.number = 1;
  tell(network, command);
  command.finish = true;
  tell(network, command);
  ASSERT_TRUE(run_until(robot, [&] { return robot.finished(); }));
  const std::optional<RobotInfo> last = decode<RobotInfo>(network.to_viewer.back().payload);
  ASSERT_TRUE(last);
  EXPECT_TRUE(last->ended);
  EXPECT_EQ(last->drive_total, 2U);
  EXPECT_EQ(last->odometry_total, count(network, Service::kOdometry));
  const std::size_t said = network.to_viewer.size();
  for (int step = 0; step < 100; ++step) ASSERT_FALSE(robot.step());
  EXPECT_EQ(network.to_viewer.size(), said);
}

TEST(Robot, GarbageIsNoCommand) {
  FakeNetwork network;
  Robot robot(network.robot, simulated);
  (void)network.viewer.command(Bytes(7, std::byte{0xFF}));
  for (int step = 0; step < 10; ++step) ASSERT_FALSE(robot.step());
  EXPECT_FALSE(robot.finished());
}

TEST(Robot, TellsThatTheConnectionEnded) {
  FakeNetwork network;
  Robot robot(network.robot, simulated);
  network.broken = Error{"gone"};
  EXPECT_TRUE(robot.step());
}

}  // namespace
}  // namespace gimnet::demo
