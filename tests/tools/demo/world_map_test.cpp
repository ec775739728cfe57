#include "tools/demo/world_map.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "tests/tools/demo/temporary_file.hpp"

namespace gimnet::demo {
namespace {

using testing::HasSubstr;

constexpr std::string_view kRoom =
    "#####\n"
    "#2 1#\n"
    "# @.#\n"
    "#####\n";

std::string complaint(std::string_view text) {
  const Result<WorldMap> map = WorldMap::parse(text);
  return map ? "none" : map.error().sentence;
}

TEST(WorldMap, ReadsWallsStartAndCourse) {
  const WorldMap map = WorldMap::parse(kRoom).value();
  EXPECT_EQ(map.columns(), 5U);
  EXPECT_EQ(map.rows(), 4U);
  EXPECT_EQ(map.width_m(), 1.25);
  EXPECT_TRUE(map.wall(0, 0));
  EXPECT_FALSE(map.wall(1, 1));
  EXPECT_EQ(map.start().x_m, 0.625);
  EXPECT_EQ(map.start().y_m, 0.375);
  ASSERT_EQ(map.waypoints().size(), 2U);
  EXPECT_EQ(map.waypoints()[0].x_m, 0.875);
  EXPECT_EQ(map.waypoints()[1].x_m, 0.375);
  EXPECT_EQ(map.text(), kRoom);
}

TEST(WorldMap, OutsideIsWall) {
  const WorldMap map = WorldMap::parse("@").value();
  EXPECT_FALSE(map.wall(0, 0));
  for (const auto& [column, row] : {std::pair{-1L, 0L}, {0L, -1L}, {1L, 0L}, {0L, 1L}}) {
    EXPECT_TRUE(map.wall(column, row));
  }
}

TEST(WorldMap, RefusesMapsThatMeanNothing) {
  EXPECT_THAT(complaint(""), HasSubstr("no start"));
  EXPECT_THAT(complaint("###\n# #\n###"), HasSubstr("no start"));
  EXPECT_THAT(complaint("#@#\n#x#"), HasSubstr("line 2, column 2: a character (code 120)"));
  EXPECT_THAT(complaint("@\n @"), HasSubstr("line 2, column 2: a second start"));
  EXPECT_THAT(complaint("@11"), HasSubstr("second waypoint '1'"));
}

TEST(WorldMap, TakesTheLargestAndRefusesOneBeyond) {
  const std::string widest(WorldMap::kColumnsMax - 1, ' ');
  EXPECT_EQ(complaint("@" + widest), "none");
  EXPECT_THAT(complaint("@ " + widest), HasSubstr("at most"));
  const std::string highest(WorldMap::kRowsMax - 1, '\n');
  EXPECT_EQ(complaint("@\n" + highest), "none");
  EXPECT_THAT(complaint("@\n\n" + highest), HasSubstr("at most"));
}

TEST(WorldMap, MeasuresDistancesToWalls) {
  const WorldMap map = WorldMap::parse(kRoom).value();
  const Point start{map.start().x_m, map.start().y_m};
  EXPECT_NEAR(map.distance_to_wall_m({start, 0.0}, 10.0), 0.375, 1e-9);
  EXPECT_NEAR(map.distance_to_wall_m({start, std::numbers::pi}, 10.0), 0.375, 1e-9);
  EXPECT_NEAR(map.distance_to_wall_m({start, std::numbers::pi / 2}, 10.0), 0.375, 1e-9);
  EXPECT_NEAR(map.distance_to_wall_m({start, -std::numbers::pi / 4}, 10.0),
              0.125 * std::numbers::sqrt2, 1e-9);
  EXPECT_EQ(map.distance_to_wall_m({start, 0.0}, 0.2), 0.2);
}

TEST(WorldMap, ARayFromWithinAWallHasNoLength) {
  EXPECT_EQ(WorldMap::parse(kRoom).value().distance_to_wall_m({{0.1, 0.1}, 1.0}, 5.0), 0.0);
}

TEST(WorldMap, KnowsWhereADiskFits) {
  const WorldMap map = WorldMap::parse(kRoom).value();
  EXPECT_FALSE(map.touches_wall({0.625, 0.5}, 0.24));
  EXPECT_TRUE(map.touches_wall({0.625, 0.5}, 0.26));
}

TEST(WorldMap, LoadsAFileAndNamesItInErrors) {
  const TemporaryFile good(kRoom);
  EXPECT_TRUE(WorldMap::load(good.path()));
  const TemporaryFile bad("#?");
  EXPECT_THAT(WorldMap::load(bad.path()).error().sentence,
              HasSubstr(bad.path() + ": line 1, column 2"));
  EXPECT_FALSE(WorldMap::load("/nowhere"));
}

}  // namespace

namespace {

TEST(Hall, IsAMapOfTheSizeThatItSays) {
  const WorldMap map = WorldMap::parse(kHallText).value();
  EXPECT_EQ(map.width_m(), 18.0);
  EXPECT_EQ(map.height_m(), 12.0);
  EXPECT_EQ(map.waypoints().size(), 9U);
}

TEST(Hall, IsClosed) {
  const WorldMap map = WorldMap::parse(kHallText).value();
  const auto columns = static_cast<long>(map.columns());
  const auto rows = static_cast<long>(map.rows());
  for (long column = 0; column < columns; ++column)
    EXPECT_TRUE(map.wall(column, 0) && map.wall(column, rows - 1));
  for (long row = 0; row < rows; ++row) EXPECT_TRUE(map.wall(0, row) && map.wall(columns - 1, row));
}

}  // namespace

}  // namespace gimnet::demo
