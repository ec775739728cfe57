#include "hub/data/tables/node_table.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace gimnet::hub {
namespace {

TEST(NodeTable, IsEmptyAtFirst) {
  const NodeTable table;
  for (const std::uint32_t index : {0u, 1u, 1'000u, kEveryIndex})
    EXPECT_FALSE(table.find(index).exists());
  EXPECT_EQ(table.shards(), 0u);
}

TEST(NodeTable, RemembersPlacesToTheLastBit) {
  NodeTable table;
  const NodePlace place{ShardIndex{63}, ConnectionSlot{kSlotsMax - 1}, 0xFFFFFFFF};
  table.publish(kEveryIndex - 1, place);
  EXPECT_EQ(table.find(kEveryIndex - 1), place);
  EXPECT_FALSE(table.find(kEveryIndex - 2).exists());
  table.publish(kEveryIndex - 1, {});
  EXPECT_FALSE(table.find(kEveryIndex - 1).exists());
}

TEST(NodeTable, KnowsTheShardsWithNodes) {
  NodeTable table;
  table.publish(1, {ShardIndex{0}, ConnectionSlot{1}, 1});
  table.publish(2, {ShardIndex{5}, ConnectionSlot{2}, 1});
  table.publish(3, {ShardIndex{5}, ConnectionSlot{3}, 1});
  EXPECT_EQ(table.shards(), 0b100001u);
  EXPECT_EQ(table.nodes_on(ShardIndex{0}), 1u);
  EXPECT_EQ(table.nodes_on(ShardIndex{5}), 2u);
  EXPECT_EQ(table.nodes_on(ShardIndex{63}), 0u);
  table.publish(2, {});
  EXPECT_EQ(table.shards(), 0b100001u);
  table.publish(3, {ShardIndex{0}, ConnectionSlot{3}, 2});
  EXPECT_EQ(table.shards(), 1u);
  table.publish(3, {ShardIndex{0}, ConnectionSlot{3}, 2});
  table.publish(1, {});
  EXPECT_EQ(table.nodes_on(ShardIndex{0}), 1u);
  table.publish(3, {});
  table.publish(3, {});
  EXPECT_EQ(table.shards(), 0u);
  EXPECT_EQ(table.nodes_on(ShardIndex{0}), 0u);
}

TEST(NodeTable, KnowsWhoMayComeBack) {
  NodeTable table;
  const std::vector<std::uint32_t> expected{1, 63, 64, 4'096, 900'000, kEveryIndex - 1};
  EXPECT_FALSE(table.may_return(1));
  for (const std::uint32_t index : expected) table.expect(index);
  for (const std::uint32_t index : expected) EXPECT_TRUE(table.may_return(index)) << index;
  for (const std::uint32_t index :
       {0u, 2u, 62u, 65u, 4'095u, 4'097u, 899'999u, kEveryIndex - 2, kEveryIndex}) {
    EXPECT_FALSE(table.may_return(index)) << index;
  }
  table.expect_nobody();
  for (const std::uint32_t index : expected) EXPECT_FALSE(table.may_return(index)) << index;
}

TEST(NodeTable, WhoCameBackAndLeftIsNotExpected) {
  NodeTable table;
  table.expect(7);
  table.expect(8);
  table.publish(7, {ShardIndex{0}, ConnectionSlot{1}, 1});
  table.publish(7, {});
  EXPECT_FALSE(table.may_return(7));
  EXPECT_TRUE(table.may_return(8));
}

}  // namespace
}  // namespace gimnet::hub
