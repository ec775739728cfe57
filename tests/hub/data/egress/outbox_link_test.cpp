#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/data/support/egress_rig.hpp"

// Outboxes of links: a budget of their own, and lanes by what the link takes.

namespace gimnet::hub {
namespace {

using proto::DropReason;
using Frames = hub::Run;  // ::testing::Test has another Run
using testing::EgressRig;
using ::testing::IsEmpty;
using testing::TestConnection;
using testing::TestFrame;

constexpr std::uint8_t kBlock = 1;
constexpr std::uint64_t kKiB = 1024;
/// Group frames are dropped from the oldest on.
constexpr TestFrame kOldest{.kind = proto::Kind::group};

/// A payload that makes a frame of exactly `size` bytes.
std::string sized(std::uint64_t size) { return std::string(size - proto::kHeaderSize, 'x'); }

Limits small_budgets() {
  Limits limits;
  limits.budget_bytes = limits.link_budget_bytes = 4 << 20;
  return limits;
}

/// A node and a link that take nothing.
class OutboxLink : public ::testing::Test {
 protected:
  OutboxLink() { link.outbox.set_link(); }
  void SetUp() override {
    for (TestConnection* each : {&node, &link}) {
      each->peer.set_room(0);
      rig.push(each->outbox, "first", {.lane = 0});
      EXPECT_EQ(each->flush(), Flush::blocked);
    }
  }
  void TearDown() override { EXPECT_TRUE(rig.ledger_exact()); }

  static std::int64_t used(const Budget& budget) { return budget.total() - budget.left(); }
  [[nodiscard]] std::uint64_t waiting() { return link.outbox.lane(1).bytes(); }
  /// Have exactly so many bytes room in lane 1 of the link, with those that wait?
  [[nodiscard]] bool has_room_for_just(std::uint64_t bytes) {
    const std::uint64_t more = bytes - waiting();
    return link.outbox.has_room(more, 1, rig.limits) &&
           !link.outbox.has_room(more + 1, 1, rig.limits);
  }

  EgressRig rig{small_budgets()};
  TestConnection node{rig};
  TestConnection link{rig};
};

TEST_F(OutboxLink, WhatWaitsForItCountsAgainstTheBudgetOfLinks) {
  const std::int64_t piece = rig.budget.piece_bytes();
  EXPECT_EQ(used(rig.budget), piece);
  EXPECT_EQ(used(rig.link_budget), piece);
  for (int i = 0; i < 20; ++i) rig.push(link.outbox, sized(60 * kKiB), kOldest, i < 10);
  EXPECT_EQ(link.flush(), Flush::blocked);
  const std::int64_t of_links = used(rig.link_budget);
  EXPECT_GT(of_links, 20 * 60 * 1024);
  EXPECT_EQ(used(rig.budget), piece);
  for (int i = 0; i < 20; ++i) rig.push(node.outbox, sized(60 * kKiB), kOldest, i < 10);
  EXPECT_EQ(node.flush(), Flush::blocked);
  EXPECT_GT(used(rig.budget), 20 * 60 * 1024);
  EXPECT_EQ(used(rig.link_budget), of_links);
}

TEST_F(OutboxLink, ItsBudgetRefusesOneByteMoreToLinksAlone) {
  const auto takes = [&](TestConnection& to) {
    const std::uint64_t before = rig.dropped(DropReason::over_budget);
    rig.push(to.outbox, "more", {.flags = kBlock});
    return rig.dropped(DropReason::over_budget) == before;
  };
  struct Side {
    BudgetLease& lease;
    TestConnection& full;
    TestConnection& other;
  };
  for (Side side : {Side{rig.link_lease, link, node}, Side{rig.lease, node, link}}) {
    std::uint64_t taken = 0;
    for (; !side.lease.exhausted(); ++taken) side.lease.take(1);
    side.lease.give_back(1);
    EXPECT_TRUE(takes(side.full)) << "exactly the budget";
    side.lease.take(1);
    EXPECT_FALSE(takes(side.full));
    EXPECT_TRUE(takes(side.other));
    side.lease.give_back(taken);
    EXPECT_TRUE(takes(side.full));
  }
}

TEST_F(OutboxLink, ScarceMemoryOfLinksIsNotThatOfNodes) {
  rig.link_lease.take(7 << 19);
  rig.link_lease.begin_turn(0);
  rig.lease.begin_turn(0);
  EXPECT_TRUE(link.outbox.over_share(1 << 20, rig.context));
  EXPECT_FALSE(node.outbox.over_share(1 << 20, rig.context));
  rig.link_lease.give_back(7 << 19);
}

// The buffer would count against one budget while the other one's frame alone keeps it.
TEST_F(OutboxLink, AFrameInABufferThatTheOtherBudgetPaysForIsCopied) {
  for (auto [first, second] : {std::pair{&node, &link}, std::pair{&link, &node}}) {
    const Frames frame = rig.run({sized(20 * kKiB)}, kOldest);
    rig.accepted += 1;  // a copy
    for (TestConnection* each : {first, second}) {
      each->outbox.push(frame, frame.header(), Handover{.fan_out = true}, rig.context);
      EXPECT_EQ(each->flush(), Flush::blocked);
    }
    const auto buffer_of = [](TestConnection* of) {
      return of->outbox.lane(1).entries().back().run.buffer.get();
    };
    EXPECT_EQ(buffer_of(first)->kind, BufferKind::slab);
    EXPECT_EQ(buffer_of(first)->payer, first == &node ? &rig.lease : &rig.link_lease);
    EXPECT_EQ(buffer_of(second)->kind, BufferKind::chunk);
    EXPECT_EQ(buffer_of(second)->payer, second == &node ? &rig.lease : &rig.link_lease);
    for (int i = 0; i < 5; ++i) static_cast<void>(rig.run({sized(60 * kKiB)}));  // another slab
    rig.accepted -= 5;
  }
}

// A fast link that resumes would copy whatever it shares with a node that does.
TEST_F(OutboxLink, AFrameThatIsOnlyKeptUntilItIsConfirmedIsNotCopied) {
  TestConnection fast_node{rig};
  TestConnection fast_link{rig};
  fast_link.outbox.set_link();
  const Frames frame = rig.run({sized(20 * kKiB)}, kOldest);
  rig.accepted += 1;
  const std::uint64_t copied = rig.tally.copied_bytes;
  ResumeBuffer kept[2]{ResumeBuffer{1 << 20}, ResumeBuffer{1 << 20}};
  for (TestConnection* each : {&fast_node, &fast_link}) {
    ResumeBuffer& resume = kept[each == &fast_link ? 1 : 0];
    each->outbox.set_resume(&resume);
    each->outbox.push(frame, frame.header(), Handover{.fan_out = true}, rig.context);
    EXPECT_EQ(each->flush(&resume), Flush::emptied);
    EXPECT_EQ(resume.bytes(), 20 * kKiB);
    each->outbox.set_resume(nullptr);
  }
  EXPECT_EQ(rig.tally.copied_bytes, copied);
  rig.tally.queued -= 2;
  rig.tally.delivered += 2;
}

TEST_F(OutboxLink, ALaneHasTheLimitOfANodesUntilItsRateIsKnown) {
  rig.push(link.outbox, sized(kKiB), kOldest);
  EXPECT_TRUE(has_room_for_just(rig.limits.lane1_bytes));
  link.outbox.on_link_took(100 * kKiB, true);
  EXPECT_TRUE(has_room_for_just(rig.limits.lane1_bytes)) << "it could have taken more";
}

TEST_F(OutboxLink, ALaneHasRoomForWhatTheLinkTookWithinBounds) {
  rig.push(link.outbox, sized(kKiB), kOldest);
  for (const auto& [took, limit] : {std::pair{std::uint64_t{0}, Outbox::kLinkLaneBytesMin},
                                    {Outbox::kLinkLaneBytesMin, Outbox::kLinkLaneBytesMin},
                                    {Outbox::kLinkLaneBytesMin + 1, Outbox::kLinkLaneBytesMin + 1},
                                    {Outbox::kLinkLaneBytesMax, Outbox::kLinkLaneBytesMax},
                                    {Outbox::kLinkLaneBytesMax + 1, Outbox::kLinkLaneBytesMax},
                                    {UINT64_MAX, Outbox::kLinkLaneBytesMax}}) {
    link.outbox.on_link_took(took, false);
    EXPECT_TRUE(has_room_for_just(limit)) << took;
  }
}

TEST_F(OutboxLink, OnceItWasEmptyItTookAtLeastSoMuch) {
  rig.push(link.outbox, sized(kKiB), kOldest);
  link.outbox.on_link_took(500 * kKiB, false);
  link.outbox.on_link_took(499 * kKiB, true);
  EXPECT_TRUE(has_room_for_just(500 * kKiB));
  link.outbox.on_link_took(501 * kKiB, true);
  EXPECT_TRUE(has_room_for_just(501 * kKiB));
}

TEST_F(OutboxLink, ALowerLimitDropsTheOldestWhenAnotherMessageComes) {
  // Neighbours have different headers, or they would go together.
  for (std::uint32_t i = 0; i < 100; ++i)
    rig.push(link.outbox, sized(10 * kKiB), {.kind = proto::Kind::group, .dst = i % 2});
  link.outbox.on_link_took(0, false);
  EXPECT_EQ(waiting(), 1'000 * kKiB) << "nothing is dropped by the change itself";
  rig.push(link.outbox, sized(10 * kKiB), kOldest);
  EXPECT_EQ(waiting(), 250 * kKiB);
  EXPECT_EQ(rig.dropped(DropReason::queue_full), 76u);
}

TEST_F(OutboxLink, MessagesSentWithBlockHaveTheRoomThatANodeHas) {
  for (int i = 0; i < 12; ++i) rig.push(link.outbox, sized(60 * kKiB), {.flags = kBlock});
  link.outbox.on_link_took(0, false);
  rig.push(link.outbox, sized(48 * kKiB), {.flags = kBlock});
  EXPECT_THAT(rig.signals.take(), IsEmpty()) << "exactly half of the lane";
  rig.push(link.outbox, sized(16), {.flags = kBlock});
  EXPECT_EQ(rig.signals.take().size(), 1u);
  // The others have half of what the link takes, however much of BLOCK waits.
  EXPECT_TRUE(has_room_for_just(waiting() + Outbox::kLinkLaneBytesMin / 2));
  EXPECT_FALSE(rig.tally.any_dropped);
}

}  // namespace
}  // namespace gimnet::hub
