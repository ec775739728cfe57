#include "hub/data/tables/group_table.hpp"

#include <gtest/gtest.h>

namespace gimnet::hub {
namespace {

TEST(GroupTable, ExchangesMembers) {
  GroupTable table;
  EXPECT_EQ(table.find(0), nullptr);
  EXPECT_EQ(table.find(kIndexMask), nullptr);
  const GroupMembers first;
  const GroupMembers second;
  EXPECT_EQ(table.exchange(kIndexMask, &first), nullptr);
  EXPECT_EQ(table.find(kIndexMask), &first);
  EXPECT_EQ(table.exchange(kIndexMask, &second), &first);
  EXPECT_EQ(table.exchange(kIndexMask, nullptr), &second);
  EXPECT_EQ(table.find(kIndexMask), nullptr);
}

}  // namespace
}  // namespace gimnet::hub
