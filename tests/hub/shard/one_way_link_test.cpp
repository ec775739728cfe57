#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/shard/support/hub_rig.hpp"

// A link that may not bring what nodes of the hub behind it send.

namespace gimnet::hub {
namespace {

using proto::DropReason;
using testing::FakeNode;
using testing::HubRig;
using ::testing::SizeIs;

constexpr HubId kNear{20};

// Nothing that would tell what became of it comes back.
TEST(OneWayLink, TakesNoFrameThatWantsAReport) {
  for (const bool one_way : {true, false}) {
    HubRig rig;
    FakeNode& node = rig.join(0);
    FakeNode& link = rig.link(0, kNear);
    const NodePlace place{link.shard, link.session.slot, link.session.generation};
    rig.routes().publish(kNear, {place, kNear, one_way});
    EXPECT_EQ(rig.routes().find(kNear), (NextHop{place, kNear, one_way}));
    const std::uint32_t to = make_id<NodeId>(kNear, 9).value();
    rig.send(node, to, "tell me", {.flags = proto::kFlagReport});
    rig.send(node, to, "whatever");
    rig.settle();
    EXPECT_THAT(link.texts(), SizeIs(one_way ? 1 : 2));
    EXPECT_EQ(link.texts().back(), "whatever");
    EXPECT_THAT(node.reports(), SizeIs(one_way ? 1 : 0));
    EXPECT_EQ(rig.dropped(DropReason::not_allowed), one_way ? 1u : 0u);
  }
}

}  // namespace
}  // namespace gimnet::hub
