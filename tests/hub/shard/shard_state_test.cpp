#include "hub/shard/shard_state.hpp"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace gimnet::hub
