#include "tools/demo/simulated_robot.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <string>
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

namespace {

// A room of 10 m by 10 m.
WorldMap room() {
  std::string text;
  for (int row = 0; row < 40; ++row) text += std::string(40, row == 20 ? '.' : ' ') + "\n";
  text[0] = '@';
  return WorldMap::parse(text).value();
}

DifferentialDrive drive_at(const Pose& pose) { return {pose, DriveSpec{}}; }

void run(DifferentialDrive& drive, const Twist& command, double seconds) {
  const WorldMap map = room();
  for (int step = 0; step < static_cast<int>(seconds / 0.01 + 0.5); ++step)
    drive.step(command, 0.01, map);
}

TEST(DifferentialDrive, DrivesStraight) {
  DifferentialDrive drive = drive_at({2.0, 5.0, 0.0});
  run(drive, {1.0, 0.0}, 2.0);
  EXPECT_NEAR(drive.pose().y_m, 5.0, 1e-9);
  // 0.4 s to gather speed, 1.6 s at 1 m/s.
  EXPECT_NEAR(drive.pose().x_m, 2.0 + 0.2 + 1.6, 0.02);
  EXPECT_NEAR(drive.twist().linear_mps, 1.0, 1e-9);
}

TEST(DifferentialDrive, TurnsOnTheSpot) {
  DifferentialDrive drive = drive_at({5.0, 5.0, 0.0});
  run(drive, {0.0, 1.0}, 3.0);
  EXPECT_NEAR(drive.pose().x_m, 5.0, 1e-9);
  EXPECT_NEAR(drive.pose().heading_rad, 3.0, 0.1);
}

TEST(DifferentialDrive, DrivesACircleAndComesBack) {
  DifferentialDrive drive = drive_at({5.0, 4.0, 0.0});
  run(drive, {0.5, 0.5}, 1.0);
  const Pose on_circle = drive.pose();
  run(drive, {0.5, 0.5}, 4.0 * std::numbers::pi);
  EXPECT_NEAR(drive.pose().x_m, on_circle.x_m, 0.01);
  EXPECT_NEAR(drive.pose().y_m, on_circle.y_m, 0.01);
}

TEST(DifferentialDrive, GathersSpeedNoFasterThanItsWheels) {
  DifferentialDrive drive = drive_at({2.0, 5.0, 0.0});
  run(drive, {1.0, 0.0}, 0.1);
  EXPECT_NEAR(drive.twist().linear_mps, 0.25, 1e-9);
}

TEST(DifferentialDrive, TooFastACommandKeepsItsCurve) {
  DifferentialDrive drive = drive_at({2.0, 5.0, 0.0});
  run(drive, {10.0, 5.0}, 1.0);
  EXPECT_LE(drive.twist().linear_mps, DriveSpec{}.wheel_speed_max_mps);
  EXPECT_NEAR(drive.twist().angular_radps / drive.twist().linear_mps, 0.5, 0.01);
}

TEST(DifferentialDrive, WallsStopItAndItGetsAwayAgain) {
  DifferentialDrive drive = drive_at({9.0, 5.0, 0.0});
  run(drive, {1.0, 0.0}, 3.0);
  EXPECT_TRUE(drive.bumped());
  EXPECT_LE(drive.pose().x_m, 10.0 - DriveSpec{}.radius_m);
  EXPECT_GT(drive.pose().x_m, 9.6);
  run(drive, {0.0, 1.5}, 2.5);
  run(drive, {1.0, 0.0}, 2.0);
  EXPECT_FALSE(drive.bumped());
  EXPECT_LT(drive.pose().x_m, 9.0);
}

}  // namespace

namespace {

LaserSpec quiet() {
  LaserSpec spec;
  spec.noise_m = 0.0;
  return spec;
}

WorldMap corridor() { return WorldMap::parse("#########\n#@      #\n#########\n").value(); }

TEST(Laser, SeesHalfACircle) {
  Laser laser(quiet(), 1);
  const std::vector<float> ranges_m = laser.scan(corridor().start(), corridor());
  ASSERT_EQ(ranges_m.size(), 181U);
  EXPECT_NEAR(ranges_m[0], 0.125, 1e-6);
  EXPECT_NEAR(ranges_m[90], 1.625, 1e-6);
  EXPECT_NEAR(ranges_m[180], 0.125, 1e-6);
}

TEST(Laser, AnswersItsReachWhereThereIsNothing) {
  LaserSpec spec;
  spec.range_max_m = 1.0;
  Laser laser(spec, 1);
  EXPECT_EQ(laser.scan(corridor().start(), corridor())[90], 1.0F);
}

TEST(Laser, NoiseIsSmallAndRepeatable) {
  Laser one(LaserSpec{}, 5);
  Laser other(LaserSpec{}, 5);
  const std::vector<float> ranges_m = one.scan(corridor().start(), corridor());
  EXPECT_EQ(ranges_m, other.scan(corridor().start(), corridor()));
  EXPECT_NE(ranges_m, one.scan(corridor().start(), corridor()));
  EXPECT_NEAR(ranges_m[90], 1.625, 0.06);
}

}  // namespace

}  // namespace gimnet::demo
