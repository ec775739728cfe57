#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/shard/support/hub_rig.hpp"

// A group's provider changes while a shard stands still to which both handed frames over.

namespace gimnet::hub {
namespace {

using proto::DropReason;
using proto::Kind;
using ::testing::ElementsAre;
using testing::FakeNode;
using testing::FrameSpec;
using testing::HubRig;

constexpr FrameSpec kGroup{.kind = Kind::group};

/// Providers on the first two shards, a subscriber on the third, which takes no turn by itself.
class ProviderChange : public ::testing::Test {
 protected:
  void say(FakeNode& provider, const std::string& text) {
    rig.send(provider, HubRig::group(5), text, kGroup);
    rig.turn_shard(provider.shard.value());
  }
  void provide(NodeId provider) { rig.publish_group(5, provider, {&subscriber}); }

  HubRig rig{3};
  FakeNode& former = rig.join(0);
  FakeNode& next = rig.join(1);
  FakeNode& subscriber = rig.join(2);
};

TEST_F(ProviderChange, NobodyGetsAFormerProvidersFrameAfterOneOfTheNext) {
  provide(former.id);
  say(former, "taken before");
  rig.turn_shard(2);
  say(former, "on its way");
  provide(next.id);
  say(next, "of the next");
  say(former, "too late");
  rig.settle();
  EXPECT_THAT(subscriber.texts(), ElementsAre("taken before", "of the next"));
  EXPECT_EQ(rig.dropped(DropReason::not_allowed), 2u);
  EXPECT_TRUE(rig.ledger().exact());
}

TEST_F(ProviderChange, TheLastFramesOfOneThatLeftAreDelivered) {
  provide(former.id);
  say(former, "on its way");
  provide(NodeId{});
  say(former, "too late");
  rig.settle();
  EXPECT_THAT(subscriber.texts(), ElementsAre("on its way"));
  EXPECT_EQ(rig.dropped(DropReason::no_such_group), 1u);
}

TEST_F(ProviderChange, WhoComesBackGoesOn) {
  provide(former.id);
  say(former, "one");
  provide(NodeId{});
  provide(former.id);
  say(former, "two");
  rig.settle();
  EXPECT_THAT(subscriber.texts(), ElementsAre("one", "two"));
  EXPECT_EQ(rig.ledger().dropped, 0u);
}

}  // namespace
}  // namespace gimnet::hub
