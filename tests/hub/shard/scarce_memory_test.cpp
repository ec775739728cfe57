#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/shard/support/hub_rig.hpp"

// Tests a shard while less than a third of the hub's memory budget is free, mostly less than a
// sixth.

namespace gimnet::hub {
namespace {

using proto::DropReason;
using testing::FakeNode;
using testing::HubRig;
using ::testing::SizeIs;

// A share is far less than a quarter of a resume buffer, after which a peer confirms by itself.
TEST(ScarceMemory, AsksForTheConfirmThatAShareWaitsFor) {
  constexpr std::uint64_t kTaken = 250 << 20;
  constexpr int kWaiting = 5'000;
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

// 75 readers that take little once cost a healthy pair a fifth of its burst.
TEST(ScarceMemory, ABurstToANodeThatReadsIsNotCut) {
  constexpr std::uint64_t kTaken = 200 << 20;  // more than a sixth is free
  constexpr int kSlow = 5'000;
  constexpr int kBurst = 1'000;
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0);
  BudgetLease& lease = rig.state(0).budget;
  lease.take(kTaken);
  for (int i = 0; i < kSlow; ++i) lease.begin_waiting();
  const auto burst = [&] {
    b.pipe.set_room(0);
    for (int i = 0; i < kBurst; ++i) {
      rig.send(a, b.id.value(), std::string(1'000, 'x'),
               {.flags = static_cast<std::uint8_t>(proto::Policy::drop)});
      if (i % 20 == 0) rig.turn();
    }
    rig.settle_without_reading();
  };
  burst();
  b.pipe.set_room(MemoryPeer::kAll);
  rig.settle();
  EXPECT_THAT(b.frames, SizeIs(kBurst));
  EXPECT_EQ(rig.dropped(DropReason::over_budget), 0u);
  burst();
  rig.pass_ms(Outbox::kBurstMs);
  rig.send(a, b.id.value(), "one more", {.flags = static_cast<std::uint8_t>(proto::Policy::drop)});
  rig.settle_without_reading();
  EXPECT_EQ(rig.dropped(DropReason::over_budget), 1u) << "it does not keep up";
  EXPECT_EQ(rig.dropped(DropReason::queue_full), 0u);
  for (int i = 0; i < kSlow; ++i) lease.end_waiting();
  lease.give_back(kTaken);
}

// Each has a budget of its own: whatever waits for the ones, the others have whole lanes.
TEST(ScarceMemory, OfLinksIsNotThatOfNodes) {
  constexpr HubId kFirst{20};
  for (const bool links_are_full : {true, false}) {
    Limits limits;
    (links_are_full ? limits.link_budget_bytes : limits.budget_bytes) = 4 << 20;
    HubRig rig(1, limits);
    FakeNode& a = rig.join(0);
    const auto flood = [&](bool link, std::uint8_t lane, std::uint16_t number) {
      const HubId hub{static_cast<std::uint16_t>(kFirst.value() + number)};
      FakeNode& to = link ? rig.link(0, hub) : rig.join(0);
      to.pipe.set_room(0);
      const std::uint32_t dst = link ? make_id<NodeId>(hub, 1).value() : to.id.value();
      for (int i = 0; i < 150; ++i)
        rig.send(a, dst, std::string(10'000, 'x'), {.flags = 2, .lane = lane});
      rig.settle_without_reading();
      return rig.counts(to).dropped;
    };
    std::uint64_t lost = 0;
    for (std::uint16_t i = 0; i < 4; ++i) lost += flood(links_are_full, 1, i);
    EXPECT_GT(lost, 0u);
    EXPECT_EQ(rig.dropped(DropReason::over_budget), lost);
    EXPECT_EQ(rig.state(0).link_budget.scarce(), links_are_full);
    EXPECT_EQ(rig.state(0).budget.scarce(), !links_are_full);
    for (std::uint16_t i = 4; i < 8; ++i) EXPECT_EQ(flood(!links_are_full, 1, i), 0u);
  }
}

}  // namespace
}  // namespace gimnet::hub
