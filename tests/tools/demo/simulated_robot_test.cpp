#include "tools/demo/simulated_robot.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace gimnet::demo {
namespace {

constexpr std::int64_t kStart_ns = 1'000'000'000'000;
constexpr std::int64_t kSecond_ns = 1'000'000'000;

struct Heard {
  std::vector<Odometry> odometry;
  std::vector<Scan> scans;
  RobotSource::Output output{[this](const Odometry& message) { odometry.push_back(message); },
                             [this](const Scan& message) { scans.push_back(message); }};
};

DriveCommand ahead(std::uint64_t number) { return {{number, 42}, {0.5, 0.0}}; }

TEST(SimulatedRobot, SpeaksAtItsRates) {
  SimulatedRobot robot(WorldMap::hall(), kStart_ns);
  Heard heard;
  for (std::int64_t now_ns = kStart_ns; now_ns <= kStart_ns + kSecond_ns; now_ns += 1'000'000) {
    robot.advance(now_ns, heard.output);
  }
  EXPECT_EQ(heard.odometry.size(), 40U);
  EXPECT_EQ(heard.scans.size(), 10U);
  EXPECT_EQ(heard.odometry.front().stamp.number, 1U);
  EXPECT_EQ(heard.odometry.back().stamp.number, 40U);
  EXPECT_EQ(heard.scans.back().stamp.number, 10U);
  EXPECT_EQ(heard.scans.back().ranges_m.size(), 181U);
}

TEST(SimulatedRobot, FollowsACommandAndSaysWhich) {
  SimulatedRobot robot(WorldMap::hall(), kStart_ns);
  Heard heard;
  robot.handle(ahead(9), kStart_ns);
  robot.advance(kStart_ns + kSecond_ns / 2, heard.output);
  EXPECT_GT(heard.odometry.back().pose.x_m, WorldMap::hall().start().x_m + 0.1);
  EXPECT_EQ(heard.odometry.back().answers.number, 9U);
  EXPECT_EQ(heard.odometry.back().answers.made_ns, 42);
}

TEST(SimulatedRobot, StopsWhenItsDriverIsGone) {
  SimulatedRobot robot(WorldMap::hall(), kStart_ns);
  Heard heard;
  robot.handle(ahead(1), kStart_ns);
  for (int step = 1; step <= 80; ++step)
    robot.advance(kStart_ns + step * SimulatedRobot::kPeriod_ns, heard.output);
  EXPECT_NEAR(heard.odometry[15].twist.linear_mps, 0.5, 1e-9);
  EXPECT_EQ(heard.odometry.back().twist.linear_mps, 0.0);
}

TEST(SimulatedRobot, DoesNotMakeUpForALongStop) {
  SimulatedRobot robot(WorldMap::hall(), kStart_ns);
  Heard heard;
  robot.advance(kStart_ns + 3600 * kSecond_ns, heard.output);
  EXPECT_LE(heard.odometry.size(), 21U);
  EXPECT_GT(robot.next_due_ns(), kStart_ns + 3600 * kSecond_ns);
}

TEST(SimulatedRobot, SendsItsMap) {
  const RobotInfo info = SimulatedRobot(WorldMap::hall(), kStart_ns).info();
  EXPECT_EQ(info.source, "simulation");
  EXPECT_EQ(info.map, WorldMap::hall().text());
  EXPECT_FALSE(info.ended);
}

}  // namespace
}  // namespace gimnet::demo
