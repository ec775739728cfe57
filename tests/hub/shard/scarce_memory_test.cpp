#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/shard/support/hub_rig.hpp"

// Tests a shard while less than a third of the hub's memory budget is free.

namespace gimnet::hub {
namespace {

using proto::DropReason;
using testing::FakeNode;
using testing::HubRig;
using ::testing::SizeIs;

// A share is far less than a quarter of a resume buffer, after which a peer confirms by itself.
TEST(ScarceMemory, AsksForTheConfirmThatAShareWaitsFor) {
  constexpr std::uint64_t kTaken = 250 << 20;
  constexpr int kWaiting = 10'000;
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0, {.resume = true});
  BudgetLease& lease = rig.state(0).budget;
  lease.take(kTaken);
  for (int i = 0; i < kWaiting; ++i) lease.begin_waiting();
  for (int i = 0; i < 20; ++i) rig.send(a, b.id.value(), std::string(1'000, 'x'));
  std::uint64_t asked = 0;
  rig.settle();
  while (b.frames.size() < 20) {
    ASSERT_GT(b.flow_of<proto::flow::Ping>().size(), asked) << b.frames.size() << " frames";
    asked = b.flow_of<proto::flow::Ping>().size();
    ASSERT_LE(rig.connection(b)->resume->kept.bytes(), lease.share_bytes() / 2);
    rig.send_flow(b, proto::flow::Confirm{b.frames.size()});
    rig.settle();
  }
  EXPECT_GE(asked, 4u) << "four of them fit";
  EXPECT_GT(rig.sum(&ShardCounters::scarce_turns), 0u);
  EXPECT_EQ(rig.ledger().dropped, 0u);
  for (int i = 0; i < kWaiting; ++i) lease.end_waiting();
  lease.give_back(kTaken);
}

// Its lane has room for much more, and nothing else would be said of it before it is back.
TEST(ScarceMemory, TheSenderToAnAbsentNodeGoesOnOnceMemoryIsNotScarce) {
  constexpr std::uint64_t kTaken = 250 << 20;
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& absent = rig.join(0, {.resume = true});
  absent.pipe.reset();
  rig.settle();
  rig.state(0).budget.take(kTaken);
  for (int i = 0; i < 5; ++i) rig.send(a, absent.id.value(), std::string(60'000, 'x'));
  rig.settle();
  EXPECT_THAT(a.flow_of<proto::flow::Pause>(), SizeIs(1));
  rig.pass_ms(200);
  a.read();
  EXPECT_THAT(a.flow_of<proto::flow::Resume>(), SizeIs(0));
  rig.state(0).budget.give_back(kTaken);
  rig.pass_ms(200);
  a.read();
  EXPECT_THAT(a.flow_of<proto::flow::Resume>(), SizeIs(1));
  EXPECT_EQ(rig.ledger().dropped, 0u);
}

// The budget is not the one's who comes first.
TEST(ScarceMemory, AConnectionWaitsAloneForItsShare) {
  constexpr std::uint64_t kTaken = 250 << 20;
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& slow = rig.join(0);
  FakeNode& healthy = rig.join(0);
  rig.state(0).budget.take(kTaken);
  slow.pipe.set_room(0);
  for (int i = 0; i < 40; ++i) {
    rig.send(a, slow.id.value(), std::string(10'000, 'x'),
             {.flags = static_cast<std::uint8_t>(proto::Policy::drop)});
    rig.send(a, healthy.id.value(), std::string(10'000, 'x'),
             {.flags = static_cast<std::uint8_t>(proto::Policy::drop)});
    rig.turn();
    healthy.read();
  }
  EXPECT_THAT(healthy.frames, SizeIs(40));
  EXPECT_GT(rig.dropped(DropReason::over_budget), 10u);
  EXPECT_LE(rig.state(0).pool.pinned_bytes(), BudgetLease::kShareBytesMax + 32 * 1'024);
  slow.pipe.set_room(MemoryPeer::kAll);
  rig.settle();
  EXPECT_EQ(rig.state(0).pool.pinned_bytes(), 0u);
  rig.state(0).budget.give_back(kTaken);
}

}  // namespace
}  // namespace gimnet::hub
