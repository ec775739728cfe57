#include "tools/demo/laser.hpp"

#include <gtest/gtest.h>

namespace gimnet::demo {
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

TEST(LaserSpec, OneBeamLooksAhead) {
  LaserSpec spec;
  spec.beams = 1;
  EXPECT_EQ(spec.bearing_rad(0), 0.0);
}

}  // namespace
}  // namespace gimnet::demo
