#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/shard/support/hub_rig.hpp"

// One shard that has too much to do, and those who send to the others.

namespace gimnet::hub {
namespace {

using testing::FakeNode;
using testing::HubRig;
using ::testing::SizeIs;

TEST(CrowdedShard, KeepsNobodyWaitingWhoSendsToAnother) {
  Limits limits;
  limits.mailbox_bytes = 256 * 1024;
  HubRig rig(3, limits);
  FakeNode& to_busy = rig.join(0);
  FakeNode& to_other = rig.join(0);
  FakeNode& busy = rig.join(1);
  FakeNode& other = rig.join(2);
  for (int i = 0; i < 1'000; ++i) {
    rig.send(to_busy, busy.id.value(), std::string(1'000, 'x'));
    rig.send(to_other, other.id.value(), std::string(1'000, 'x'));
  }
  for (int i = 0; i < 50; ++i) rig.turn_shard(0);
  EXPECT_TRUE(to_busy.pipe.transport_readable());
  EXPECT_TRUE(to_other.pipe.transport_readable()) << "both mailboxes are more than half full";
  for (int i = 0; i < 200; ++i) {
    rig.turn_shard(2);
    other.read();
    rig.turn_shard(0);
  }
  EXPECT_THAT(other.frames, SizeIs(1'000));
  EXPECT_TRUE(to_busy.pipe.transport_readable());
  rig.settle();
  EXPECT_THAT(busy.frames, SizeIs(1'000));
  EXPECT_EQ(rig.ledger().dropped, 0u);
}

}  // namespace
}  // namespace gimnet::hub
