#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "hub/control/conductor.hpp"
#include "proto/control/ns.hpp"
#include "tests/hub/control/support/test_conductor.hpp"

// What a node hears before what: its own answer, and what the answer is about.

namespace gimnet::hub {
namespace {

namespace ns = proto::ns;
using ::testing::ElementsAre;

class AnswerOrderTest : public ::testing::Test, protected TestConductor {
 protected:
  /// "answer" and "pace", as they went to the node's shard.
  std::vector<std::string> order_for(const Node& node) {
    std::vector<std::string> order;
    for (const auto& sent : shards.sent) {
      const auto* control = std::get_if<SendControlCommand>(&sent.command);
      const auto* pace = std::get_if<PaceCommand>(&sent.command);
      if (control != nullptr && control->session.generation == node.session.generation) order.emplace_back("answer");
      if (pace != nullptr && pace->session.generation == node.session.generation) order.emplace_back("pace");
    }
    return order;
  }
  Node provide(ns::Delivery delivery, std::uint32_t window, bool retain) {
    const Node robot = join("robot");
    ns::Advertise offer{.service = "odom"};
    offer.delivery = delivery;
    offer.window = window;
    offer.retain = retain;
    EXPECT_TRUE(ask<ns::AdvertiseAnswer>(robot, offer));
    return robot;
  }
};

TEST_F(AnswerOrderTest, AWindowIsKnownBeforeAMessageCountsInIt) {
  provide(ns::Delivery::sync, 1, true);
  const Node viewer = join("viewer");
  shards.sent.clear();
  ASSERT_TRUE(ask<ns::SubscribeAnswer>(viewer, ns::Subscribe{"robot/odom"}));
  EXPECT_THAT(order_for(viewer), ElementsAre("answer", "pace"));
}

TEST_F(AnswerOrderTest, WhoWaitedForAServiceHearsOfItsWindowFirstToo) {
  const Node viewer = join("viewer");
  ASSERT_TRUE(ask<ns::SubscribeAnswer>(viewer, ns::Subscribe{"robot/odom"}));
  shards.sent.clear();
  provide(ns::Delivery::sync, 1, true);
  EXPECT_THAT(order_for(viewer), ElementsAre("answer", "pace"));  // SERVICE_MOVED, to be exact
}

TEST_F(AnswerOrderTest, ANewPaceBeginsWhenItsTermsAreKnown) {
  provide(ns::Delivery::stream, 0, false);
  const Node viewer = join("viewer");
  ASSERT_TRUE(ask<ns::SubscribeAnswer>(viewer, ns::Subscribe{"robot/odom"}));
  shards.sent.clear();
  ns::Subscribe slower{"robot/odom"};
  slower.rate_hz = 2.0;
  ASSERT_TRUE(ask<ns::SubscribeAnswer>(viewer, slower));
  EXPECT_THAT(order_for(viewer), ElementsAre("answer", "pace"));
}

}  // namespace
}  // namespace gimnet::hub
