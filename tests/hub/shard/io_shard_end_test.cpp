#include "hub/shard/io_shard.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "tests/hub/shard/support/hub_rig.hpp"

namespace gimnet::hub {
namespace {

using testing::FakeNode;
using testing::HubRig;

constexpr auto kDrop = static_cast<std::uint8_t>(proto::Policy::drop);

// Frames that wait between shards when the hub ends are let go on both sides.
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
  const auto pinned = [&] {
    return rig.state(0).pool.pinned_bytes() + rig.state(1).pool.pinned_bytes();
  };
  ASSERT_GT(pinned(), 0u);
  ASSERT_GT(rig.ledger().queued, 0u);
  rig.let_go();
  EXPECT_EQ(pinned(), 0u);
  for (const std::size_t shard : {0u, 1u}) {
    rig.state(shard).pool.take_back_lent();
    EXPECT_EQ(rig.state(shard).pool.lent_buffers(), 0u);
  }
}

// A turn remembers a run, and so keeps its buffer, here another shard's, only until the turn is
// over.
TEST(IoShard, KeepsNoBufferForTheNextTurnThatNobodyWaitsFor) {
  Limits limits;
  limits.lane1_bytes = 4'000;
  HubRig rig(2, limits);
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(1);
  b.pipe.set_room(0);
  std::vector<std::byte> burst;
  for (int i = 0; i < 1'000; ++i) {
    const auto frame = HubRig::frame(a, b.id.value(), i % 2 == 0 ? "" : "x", {.flags = kDrop});
    burst.insert(burst.end(), frame.begin(), frame.end());
  }
  for (int i = 0; i < 3; ++i) {
    rig.write(a, burst);
    rig.turn();
  }
  ASSERT_GT(rig.dropped(proto::DropReason::queue_full), 1'000u);
  rig.release(b);
  rig.settle();
  rig.state(0).pool.take_back_lent();
  EXPECT_EQ(rig.state(0).pool.lent_buffers(), 0u);
  EXPECT_EQ(rig.state(1).pool.pinned_bytes(), 0u);
}

TEST(IoShard, SaysWhatIsWrongWithALinkMessage) {
  const std::string goodbye_without_code("\x03\x00\x00\x00", 4);
  const std::string hello("\x01\x00\x00\x00", 4);
  for (const auto& [payload, sentence] :
       {std::pair{goodbye_without_code, "GOODBYE has no code (key 1)"},
        std::pair{hello, "after WELCOME the only LINK message is GOODBYE"}}) {
    HubRig rig;
    FakeNode& node = rig.join(0);
    rig.send(node, 0, payload, {.kind = proto::Kind::link, .src = 0});
    rig.settle();
    ASSERT_TRUE(node.goodbye);
    EXPECT_EQ(node.goodbye->code, proto::GoodbyeCode::malformed);
    EXPECT_EQ(node.goodbye->sentence, sentence);
  }
}

}  // namespace
}  // namespace gimnet::hub
