#include "hub/control/state/sessions.hpp"

#include <gtest/gtest.h>

namespace gimnet::hub {
namespace {

TEST(NumberFloor, IsZeroWhereNothingWasRaised) {
  NumberFloor floor;
  EXPECT_EQ(floor.at(NodeIndex{1}), 0u);
  floor.raise(NodeIndex{1'048'574}, 7);
  EXPECT_EQ(floor.at(NodeIndex{1'048'574}), 7u);
  EXPECT_EQ(floor.at(NodeIndex{1'048'573}), 0u);
  EXPECT_EQ(floor.at(NodeIndex{5}), 0u);
}

TEST(NumberFloor, NeverFalls) {
  NumberFloor floor;
  floor.raise(NodeIndex{9}, 7);
  floor.raise(NodeIndex{9}, 3);
  EXPECT_EQ(floor.at(NodeIndex{9}), 7u);
  floor.raise(NodeIndex{9}, 8);
  EXPECT_EQ(floor.at(NodeIndex{9}), 8u);
}

}  // namespace
}  // namespace gimnet::hub
