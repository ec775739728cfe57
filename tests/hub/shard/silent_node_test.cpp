#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/shard/support/hub_rig.hpp"

// Nodes that say nothing by themselves, though the hub sends to them all the time.

namespace gimnet::hub {
namespace {

using proto::GoodbyeCode;
using testing::FakeNode;
using testing::HubRig;
using ::testing::SizeIs;

// A library that is busy reading may say nothing by itself. It answers a PING.
TEST(SilentNode, IsAskedOnceHoweverMuchItIsSent) {
  HubRig rig;
  FakeNode& busy = rig.join(0);
  FakeNode& sender = rig.join(0);
  const auto pass = [&](int steps) {
    for (int step = 0; step < steps; ++step) {
      rig.send(sender, busy.id.value(), "flood");
      rig.pass_ms(100, false);
      rig.settle();
    }
  };
  pass(14);
  EXPECT_THAT(busy.flow_of<proto::flow::Ping>(), SizeIs(0)) << "the hub wrote all the time";
  pass(2);
  EXPECT_THAT(busy.flow_of<proto::flow::Ping>(), SizeIs(1));
  pass(12);
  EXPECT_THAT(busy.flow_of<proto::flow::Ping>(), SizeIs(1)) << "one until it is heard";
  rig.send_flow(busy, proto::flow::Pong{});
  pass(14);
  EXPECT_FALSE(busy.goodbye);
  EXPECT_THAT(busy.flow_of<proto::flow::Ping>(), SizeIs(1));
  pass(2);
  EXPECT_THAT(busy.flow_of<proto::flow::Ping>(), SizeIs(2));
  pass(20);
  ASSERT_TRUE(busy.goodbye) << "it did not answer";
  EXPECT_EQ(busy.goodbye->code, GoodbyeCode::silent);
}

TEST(SilentNode, IsNotAskedIfItWasPingedMeanwhile) {
  HubRig rig;
  FakeNode& silent = rig.join(0);
  rig.pass_ms(1'900, false);
  rig.settle();
  EXPECT_THAT(silent.flow_of<proto::flow::Ping>(), SizeIs(1));
}

TEST(SilentNode, IsAskedWhileItsConnectionIsFull) {
  HubRig rig;
  FakeNode& busy = rig.join(0);
  FakeNode& sender = rig.join(0);
  busy.pipe.set_room(10);
  rig.send(sender, busy.id.value(), std::string(60'000, 'x'));
  rig.settle_without_reading();
  for (int step = 0; step < 16; ++step) {
    rig.connection(busy)->last_sent_ms = rig.now_ms;  // keep-alive has nothing to do
    rig.pass_ms(100, false);
  }
  busy.pipe.set_room(MemoryPeer::kAll);
  rig.settle();
  EXPECT_THAT(busy.flow_of<proto::flow::Ping>(), SizeIs(1)) << "behind what is in the kernel";
}

}  // namespace
}  // namespace gimnet::hub
