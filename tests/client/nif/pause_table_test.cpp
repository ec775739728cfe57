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
  table.pause(target, 0);
  table.pause(target, 0);
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
    table.pause({Kind::unicast, Lane::normal, dst}, 0);
  EXPECT_EQ(table.size(), PauseTable::kPausesMax);
  EXPECT_TRUE(table.is_paused(stream_code(Kind::unicast, 1, PauseTable::kPausesMax - 1)));
  EXPECT_FALSE(table.is_paused(stream_code(Kind::unicast, 1, PauseTable::kPausesMax)));
  table.clear();
  EXPECT_EQ(table.size(), 0u);
}

TEST(PauseTable, OneAboutAnotherHubHoldsForItsTimeUnlessItIsSaidAgain) {
  PauseTable table;
  const auto at = [](std::uint16_t hub) {
    return Target{Kind::unicast, Lane::normal, make_id<NodeId>(HubId{hub}, 5).value()};
  };
  const auto is_paused = [&](std::uint16_t hub) {
    return table.is_paused(stream_code(Kind::unicast, 1, at(hub).dst));
  };
  table.pause(at(1), 0);
  table.pause(at(2), 0);
  table.pause(at(3), 0);
  EXPECT_FALSE(table.lift_overdue(HubId{1}, PauseTable::kRemoteNs - 1));
  table.pause(at(3), 5);
  EXPECT_TRUE(table.lift_overdue(HubId{1}, PauseTable::kRemoteNs));
  EXPECT_TRUE(is_paused(1)) << "the own hub says RESUME, or the connection breaks";
  EXPECT_FALSE(is_paused(2));
  EXPECT_TRUE(is_paused(3));
}

}  // namespace
}  // namespace gimnet::nif
