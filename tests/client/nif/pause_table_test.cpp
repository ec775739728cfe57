#include "client/nif/pause_table.hpp"

#include <gtest/gtest.h>

namespace gimnet::nif {
namespace {

using proto::Kind;
using proto::Lane;
using proto::flow::Target;

TEST(PauseTable, PausesOneKindLaneAndDestination) {
  PauseTable table;
  const Target target{Kind::unicast, Lane::normal, 5};
  table.pause(target);
  table.pause(target);
  EXPECT_TRUE(table.is_paused(stream_code(Kind::unicast, 1, 5)));
  EXPECT_FALSE(table.is_paused(stream_code(Kind::service, 1, 5)));
  EXPECT_FALSE(table.is_paused(stream_code(Kind::unicast, 2, 5)));
  EXPECT_FALSE(table.is_paused(stream_code(Kind::unicast, 1, 6)));
  table.resume(target);
  EXPECT_EQ(table.size(), 0u) << "one RESUME lifts any number of them";
}

TEST(PauseTable, AHubThatPausesMoreThanThereIsIsNotObeyedFurther) {
  PauseTable table;
  for (std::uint32_t dst = 0; dst <= PauseTable::kPausesMax; ++dst)
    table.pause({Kind::unicast, Lane::normal, dst});
  EXPECT_EQ(table.size(), PauseTable::kPausesMax);
  EXPECT_TRUE(table.is_paused(stream_code(Kind::unicast, 1, PauseTable::kPausesMax - 1)));
  EXPECT_FALSE(table.is_paused(stream_code(Kind::unicast, 1, PauseTable::kPausesMax)));
  table.clear();
  EXPECT_EQ(table.size(), 0u);
}

}  // namespace
}  // namespace gimnet::nif
