#include "hub/data/egress/outbox.hpp"

#include <gtest/gtest.h>

#include "tests/hub/data/support/egress_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::DropReason;
using testing::EgressRig;

class UntoldLossesTest : public ::testing::Test {
 protected:
  static NodeId node(std::uint32_t index) { return NodeId{7u << 20 | index}; }
  Entry entry(std::uint32_t source, std::size_t bytes, bool block = false) {
    Entry made;
    made.run = rig_.run({std::string(bytes, 'x')}, {.src = source});
    made.size = made.run.size;
    made.frames = 1;
    made.block = block;
    made.source = SourceBytes::place_of(node(source));
    if (block) made.source += SourceBytes::kFixed;
    return made;
  }

  EgressRig rig_;
  LaneQueue lane_;
  UntoldLosses losses_;
};

TEST_F(UntoldLossesTest, TellsWhoFilledTheLaneWhoeverLost) {
  lane_.push(entry(2, 300));
  lane_.push(entry(1, 100));
  losses_.add(entry(1, 10), lane_, DropReason::queue_full);
  losses_.add(entry(2, 10), lane_, DropReason::queue_full);
  losses_.add(entry(3, 10), lane_, DropReason::over_budget);
  EXPECT_EQ(losses_.message(), (proto::flow::Dropped{DropReason::over_budget, node(2), 3}));
}

TEST_F(UntoldLossesTest, WhatIsNeverDroppedFillsItToo) {
  lane_.push(entry(1, 100));
  lane_.push(entry(4, 300, true));
  losses_.add(entry(1, 10), lane_, DropReason::queue_full);
  EXPECT_EQ(losses_.message().source, node(4));
}

// Its waiting messages are far behind, or it only had the message that was dropped.
TEST_F(UntoldLossesTest, MayNotKnowWhoItWas) {
  for (int i = 0; i < 64; ++i) lane_.push(entry(1 + static_cast<std::uint32_t>(i % 2), 1));
  lane_.push(entry(3, 10'000));
  losses_.add(entry(1, 10), lane_, DropReason::queue_full);
  EXPECT_EQ(losses_.message().source, NodeId{});
  losses_.add(entry(3, 10), lane_, DropReason::queue_full);
  EXPECT_EQ(losses_.message().source, node(3));
}

}  // namespace
}  // namespace gimnet::hub
