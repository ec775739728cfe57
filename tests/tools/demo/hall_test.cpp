#include "tools/demo/hall.hpp"

#include <gtest/gtest.h>

#include "tools/demo/world_map.hpp"

namespace gimnet::demo {
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
