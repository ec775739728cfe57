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
  SUCCEED();
}

TEST(Ids, AreOrderedAndHashed) {
  EXPECT_LT(NodeId{1}, NodeId{2});
  const std::unordered_set<NodeId> ids{NodeId{1}, NodeId{2}, NodeId{1}};
  EXPECT_EQ(ids.size(), 2u);
}

}  // namespace
}  // namespace gimnet
