#include <gtest/gtest.h>

#include <vector>

#include "hub/shard/connection_reader.hpp"
#include "tests/hub/shard/support/hub_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::GoodbyeCode;
using testing::FakeNode;
using testing::HubRig;

TEST(ConnectionReader, ClosesWhenTooMuchIsKeptForBegunFrames) {
  Limits limits;
  limits.partial_bytes = 1 << 20;  // a slab each for three, not for four
  HubRig rig(1, limits);
  std::vector<FakeNode*> nodes;
  for (int i = 0; i < 4; ++i) nodes.push_back(&rig.join(0));
  for (FakeNode* node : nodes) {
    const auto bytes = HubRig::frame(*node, node->id.value(), std::string(5000, 'x'));
    rig.write(*node, std::span(bytes).first(4000));
  }
  rig.settle();
  EXPECT_FALSE(nodes[0]->goodbye || nodes[1]->goodbye || nodes[2]->goodbye);
  ASSERT_TRUE(nodes[3]->goodbye);
  EXPECT_EQ(nodes[3]->goodbye->code, GoodbyeCode::no_memory);
}

TEST(ConnectionReader, WhoBeganAFrameLongestAgoMakesRoomForABegunFrame) {
  Limits limits;
  limits.partial_bytes = 1 << 20;
  HubRig rig(1, limits);
  std::vector<FakeNode*> nodes;
  for (std::size_t i = 0; i < 5; ++i) {
    FakeNode& node = *nodes.emplace_back(&rig.join(0));
    const auto bytes = HubRig::frame(node, node.id.value(), std::string(5000, 'x'));
    rig.write(node, std::span(bytes).first(4000));
    rig.pass_ms(100, false);
    rig.settle();
    for (std::size_t j = 0; j <= i; ++j)
      EXPECT_EQ(nodes[j]->goodbye.has_value(), i - j >= 3) << j << " of " << i;
  }
}

}  // namespace
}  // namespace gimnet::hub
