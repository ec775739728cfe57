#include "tools/demo/course.hpp"

#include <gtest/gtest.h>

#include "tools/demo/differential_drive.hpp"
#include "tools/demo/world_map.hpp"

namespace gimnet::demo {
namespace {

TEST(Course, WithoutCornersItStandsStill) {
  Course course({});
  EXPECT_EQ(course.steer({}).linear_mps, 0.0);
  EXPECT_EQ(course.steer({}).angular_radps, 0.0);
}

TEST(Course, TurnsFirstWhereTheCornerIsBehind) {
  Course course({{-5.0, 0.1}});
  EXPECT_EQ(course.steer({}).linear_mps, 0.0);
  EXPECT_GT(course.steer({}).angular_radps, 1.0);
}

TEST(Course, DrivesAheadWhereTheCornerIs) {
  Course course({{5.0, 0.0}});
  EXPECT_GT(course.steer({}).linear_mps, 0.9);
  EXPECT_EQ(course.steer({}).angular_radps, 0.0);
}

TEST(Course, GoesRoundTheHallWithoutABump) {
  const WorldMap map = WorldMap::hall();
  DifferentialDrive drive(map.start(), DriveSpec{});
  Course course(map.waypoints());
  for (int step = 0; step < 40 * 120; ++step) {
    drive.step(course.steer(drive.pose()), 0.025, map);
    ASSERT_FALSE(drive.bumped()) << step << ": " << drive.pose().x_m << ", " << drive.pose().y_m;
  }
  EXPECT_GE(course.reached(), 2 * map.waypoints().size());
}

}  // namespace
}  // namespace gimnet::demo
