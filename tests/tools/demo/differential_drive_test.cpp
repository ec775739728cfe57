#include "tools/demo/differential_drive.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <string>

namespace gimnet::demo {
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
}  // namespace gimnet::demo
