#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/shard/support/hub_rig.hpp"

// A link that ends once nothing is under way on it.

namespace gimnet::hub {
namespace {

using proto::DropReason;
using proto::GoodbyeCode;
using testing::FakeNode;
using testing::HubRig;
using ::testing::SizeIs;

/// A link that was told to end, with a node that sends over it.
struct EndingLink {
  EndingLink() : node(rig.join(0)), link(rig.link(0, HubId{9}, {.resume = true})) {
    CloseCommand close{link.session, GoodbyeCode::done, "removed"};
    close.quiet_ms = 300;
    close.most_ms = 2'000;
    rig.command(0, std::move(close));
    rig.settle();
  }
  [[nodiscard]] bool ended_after(std::uint64_t ms) {
    rig.pass_ms(ms);
    rig.settle();
    return link.goodbye.has_value();
  }
  HubRig rig;
  FakeNode& node;
  FakeNode& link;
};

TEST(LinkEnding, ComesOnceNothingIsUnderWay) {
  EndingLink with;
  EXPECT_FALSE(with.ended_after(200));
  with.rig.send(with.node, make_id<NodeId>(HubId{9}, 5).value(), "late");
  with.rig.settle();
  EXPECT_FALSE(with.ended_after(600)) << "it is not confirmed";
  with.rig.send_flow(with.link, proto::flow::Confirm{1});
  EXPECT_FALSE(with.ended_after(200));
  const std::uint32_t src = make_id<NodeId>(HubId{9}, 5).value();
  with.rig.send(with.link, with.node.id.value(), "from there", {.src = src});
  EXPECT_FALSE(with.ended_after(200)) << "more may come";
  EXPECT_THAT(with.link.flow_of<proto::flow::Confirm>(), SizeIs(1));
  EXPECT_TRUE(with.ended_after(300));
  EXPECT_EQ(with.link.goodbye->code, GoodbyeCode::done);
  with.rig.release(with.link);
  with.rig.settle();
  EXPECT_EQ(with.rig.dropped(DropReason::link_unsure), 0u);
}

TEST(LinkEnding, OfALinkThatIsNeverQuietComesAtTheLatestTime) {
  EndingLink with;
  for (int i = 0; i < 19; ++i) {
    with.rig.send(with.node, make_id<NodeId>(HubId{9}, 5).value(), "another");
    ASSERT_FALSE(with.ended_after(100));
  }
  EXPECT_TRUE(with.ended_after(200));
}

}  // namespace
}  // namespace gimnet::hub
