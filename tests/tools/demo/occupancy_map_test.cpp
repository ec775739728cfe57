#include "tools/demo/occupancy_map.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <utility>

namespace gimnet::demo {
namespace {

std::map<std::pair<int, int>, bool> cells_of(const OccupancyMap& map) {
  std::map<std::pair<int, int>, bool> cells;
  map.for_each([&](const OccupancyMap::Cell& cell) {
    cells[{static_cast<int>(std::floor(cell.centre.x_m * 10)),
           static_cast<int>(std::floor(cell.centre.y_m * 10))}] = cell.occupied;
  });
  return cells;
}

Scan beam(const Pose& pose, float range_m) { return {{}, pose, 0.0, 0.0, 10.0, {range_m}}; }

TEST(OccupancyMap, ABeamClearsItsWayAndMarksItsEnd) {
  OccupancyMap map;
  EXPECT_TRUE(map.empty());
  map.add(beam({0.05, 0.05, 0.0}, 1.0F));
  const auto cells = cells_of(map);
  EXPECT_EQ(cells.size(), 11U);
  EXPECT_FALSE(cells.at({0, 0}));
  EXPECT_FALSE(cells.at({9, 0}));
  EXPECT_TRUE(cells.at({10, 0}));
  EXPECT_NEAR(map.bounds().most.x_m, 1.05, 1e-6);
}

TEST(OccupancyMap, WorksAcrossZeroAndFarAway) {
  OccupancyMap map;
  map.add(beam({-0.55, -0.55, 0.0}, 1.0F));
  EXPECT_FALSE(cells_of(map).at({-6, -6}));
  EXPECT_TRUE(cells_of(map).at({4, -6}));
  map.add(beam({-500.05, 700.05, 0.0}, 1.0F));
  EXPECT_EQ(cells_of(map).size(), 22U);
}

TEST(OccupancyMap, WhatMovedAwayFades) {
  OccupancyMap map;
  map.add(beam({0.05, 0.05, 0.0}, 0.5F));
  EXPECT_TRUE(cells_of(map).at({5, 0}));
  for (int scan = 0; scan < 10; ++scan) map.add(beam({0.05, 0.05, 0.0}, 1.0F));
  EXPECT_FALSE(cells_of(map).at({5, 0}));
}

TEST(OccupancyMap, ABeamThatMeetsNothingMarksNothing) {
  OccupancyMap map;
  map.add(beam({0.05, 0.05, 0.0}, 10.0F));
  EXPECT_TRUE(map.empty());
  for (const auto& [place, occupied] : cells_of(map)) EXPECT_FALSE(occupied);
  EXPECT_EQ(cells_of(map).size(), 40U);
}

TEST(OccupancyMap, FarHitsDoNotWidenTheBounds) {
  OccupancyMap map;
  Scan scan = beam({0.0, 0.0, 0.0}, 20.0F);
  scan.range_max_m = 50.0;
  map.add(scan);
  EXPECT_TRUE(map.empty());
  EXPECT_TRUE(cells_of(map).at({200, 0}));
}

}  // namespace
}  // namespace gimnet::demo
