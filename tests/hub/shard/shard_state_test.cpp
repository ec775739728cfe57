#include "hub/shard/shard_state.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <span>
#include <string>
#include <vector>

#include "tests/hub/shard/support/hub_rig.hpp"

namespace gimnet::hub {
namespace {

TEST(ShardState, FindsExactlyTheSessionThatIsMeant) {
  testing::HubRig rig(2);
  testing::FakeNode& a = rig.join(0);
  const ShardState& state = rig.state(0);
  ASSERT_NE(state.find(a.session), nullptr);
  EXPECT_EQ(state.find(a.session)->node, a.id);
  EXPECT_EQ(state.find(a.id), state.find(a.session));
  EXPECT_EQ(state.find(SessionRef{a.session.slot, a.session.generation + 1}), nullptr);
  EXPECT_EQ(state.find(SessionRef{ConnectionSlot{1'000'000}, 1}), nullptr);
  EXPECT_EQ(state.find(NodeId{7u << 20 | 999}), nullptr);
  EXPECT_EQ(state.find(NodeId{8u << 20 | 1}), nullptr) << "another hub's";
  EXPECT_EQ(rig.state(1).find(a.id), nullptr) << "another shard's";
}

TEST(ShardState, TheShardsKeepNoMoreBegunFramesTogetherThanOneAlone) {
  for (const std::size_t shards : {1u, 3u}) {
    Limits limits;
    limits.partial_bytes = 1 << 20;  // three slabs
    testing::HubRig rig(shards, limits);
    std::vector<testing::FakeNode*> nodes;
    for (std::size_t i = 0; i < 12; ++i) nodes.push_back(&rig.join(i % shards));
    for (testing::FakeNode* node : nodes) {
      const auto bytes = testing::HubRig::frame(*node, node->id.value(), std::string(5000, 'x'));
      rig.write(*node, std::span(bytes).first(4000));
    }
    rig.settle();
    const auto closed = std::count_if(nodes.begin(), nodes.end(),
                                      [](testing::FakeNode* node) { return !!node->goodbye; });
    EXPECT_EQ(closed, 9) << shards << " shards";
  }
}

}  // namespace
}  // namespace gimnet::hub
