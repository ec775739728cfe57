#include "hub/shard/io_shard.hpp"

#include <gtest/gtest.h>

#include "tests/hub/shard/support/hub_rig.hpp"

namespace gimnet::hub {
namespace {

using testing::FakeNode;
using testing::HubRig;

// What waits between shards when the hub ends is let go on both sides.
TEST(IoShard, EndsWithMailUnderWayAndWithFramesOfAnotherShardWaiting) {
  HubRig rig(2);
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(1);
  FakeNode& c = rig.join(0);
  b.pipe.set_room(0);
  c.pipe.set_room(0);
  for (int i = 0; i < 20; ++i) {
    rig.send(a, b.id.value(), std::string(30'000, 'x'));
    rig.send(b, c.id.value(), std::string(30'000, 'x'));
    rig.turn();
  }
  rig.send(a, b.id.value(), "in the mailbox");
  rig.turn_shard(0);
  const auto pinned = [&] { return rig.state(0).pool.pinned_bytes() + rig.state(1).pool.pinned_bytes(); };
  ASSERT_GT(pinned(), 0u);
  ASSERT_GT(rig.ledger().queued, 0u);
  rig.let_go();
  EXPECT_EQ(pinned(), 0u);
  for (const std::size_t shard : {0u, 1u}) {
    rig.state(shard).pool.take_back_lent();
    EXPECT_EQ(rig.state(shard).pool.lent_buffers(), 0u);
  }
}

}  // namespace
}  // namespace gimnet::hub
