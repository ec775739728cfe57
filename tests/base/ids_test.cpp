#include "base/ids.hpp"

#include <gtest/gtest.h>

#include <type_traits>
#include <unordered_set>

namespace gimnet {
namespace {

TEST(Ids, ArePackedFromHubAndIndex) {
  const auto node = make_id<NodeId>(HubId{7}, 17);
  EXPECT_EQ(node.value(), 0x00700011u);
  EXPECT_EQ(hub_of(node), HubId{7});
  EXPECT_EQ(index_of(node), 17u);
}

TEST(Ids, HoldTheLargestHubAndIndex) {
  const auto every = make_id<NodeId>(kEveryHub, kEveryIndex);
  EXPECT_EQ(every.value(), 0xFFFFFFFFu);
  EXPECT_EQ(hub_of(every), kEveryHub);
  EXPECT_EQ(index_of(every), kEveryIndex);
}

TEST(Ids, OfDifferentKindsDoNotMix) {
  static_assert(!std::is_convertible_v<NodeId, GroupId>);
  static_assert(!std::is_convertible_v<std::uint32_t, NodeId>);
  static_assert(!std::is_constructible_v<GroupId, NodeId>);
  static_assert(!std::is_convertible_v<std::uint32_t, NodeIndex>);
  static_assert(!std::is_constructible_v<GroupIndex, NodeIndex>);
  static_assert(!std::is_constructible_v<NodeIndex, NodeId>);
  SUCCEED();
}

TEST(Ids, OfOneHubAreTheIndicesOfTheirKind) {
  static_assert(std::is_same_v<decltype(make_id(HubId{7}, NodeIndex{17})), NodeId>);
  static_assert(std::is_same_v<decltype(make_id(HubId{7}, GroupIndex{17})), GroupId>);
  EXPECT_EQ(make_id(HubId{7}, NodeIndex{17}), make_id<NodeId>(HubId{7}, 17));
  EXPECT_EQ(make_id(HubId{7}, GroupIndex{17}), make_id<GroupId>(HubId{7}, 17));
  EXPECT_EQ(node_index_of(make_id(kEveryHub, NodeIndex{kEveryIndex})), NodeIndex{kEveryIndex});
  EXPECT_EQ(group_index_of(make_id(HubId{7}, kNoGroup)), kNoGroup);
}

TEST(Ids, AreOrderedAndHashed) {
  EXPECT_LT(NodeId{1}, NodeId{2});
  const std::unordered_set<NodeId> ids{NodeId{1}, NodeId{2}, NodeId{1}};
  EXPECT_EQ(ids.size(), 2u);
}

}  // namespace
}  // namespace gimnet
