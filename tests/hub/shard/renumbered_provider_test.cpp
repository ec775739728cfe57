#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "tests/hub/shard/support/hub_rig.hpp"

// What goes to and from a service while its provider is given another id: the conductor publishes
// the new id, that the former one is nobody's, and the group, and in between commands the
// provider's shard. Turns come between any two.

namespace gimnet::hub {
namespace {

using proto::DropReason;
using proto::Kind;
using proto::Policy;
using ::testing::ElementsAre;
using ::testing::ElementsAreArray;
using testing::FakeNode;
using testing::FrameSpec;
using testing::HubRig;
using testing::JoinSpec;

constexpr JoinSpec kResume{.resume = true};

NodePlace place_of(const FakeNode& node) {
  return {node.shard, node.session.slot, node.session.generation};
}

// The tables say so first, then its shard hears of it; frames under the former id are on their way
// all the time.
TEST(RenumberedProvider, AllItsFramesAreDelivered) {
  constexpr FrameSpec kGroup{.kind = Kind::group};
  HubRig rig(2);
  FakeNode& provider = rig.join(0, kResume);
  FakeNode& near = rig.join(0);
  FakeNode& far = rig.join(1);
  FakeNode& stranger = rig.join(0);
  rig.publish_group(5, provider.id, {&near, &far});
  const FakeNode former = provider;
  const auto say = [&](const std::string& text) {
    rig.write(provider, HubRig::frame(former, HubRig::group(5), text, kGroup));
    rig.turn_shard(0);
  };
  say("handed over before");
  rig.nodes().publish(400, place_of(provider));
  rig.nodes().publish(index_of(provider.id), NodePlace::renumbered());
  provider.id = make_id<NodeId>(rig.hub(), 400);
  say("read before the group says so");
  rig.publish_group(5, provider.id, {&near, &far});
  say("read before the shard hears of it");
  rig.command(0, RenumberCommand{provider.session, provider.id, "another id"});
  rig.settle();
  for (const FakeNode* each : {&near, &far}) {
    EXPECT_THAT(each->texts(), ElementsAre("handed over before", "read before the group says so",
                                           "read before the shard hears of it"));
  }
  EXPECT_EQ(rig.ledger().dropped, 0u);
  rig.send(stranger, HubRig::group(5), "not the provider", kGroup);
  rig.settle();
  EXPECT_EQ(rig.dropped(DropReason::not_allowed), 1u);
}

/// A service that accepts data, whose provider is given the id 400 step by step, and who sends to
/// it after each.
class RenumberedReceiver {
 public:
  explicit RenumberedReceiver(Policy policy)
      : service_{.kind = Kind::service, .flags = static_cast<std::uint8_t>(policy)} {
    rig.publish_group(5, provider.id, {}, true);
  }

  /// From both shards; what goes to the other one is under way there in the next step.
  void step(const std::string& name, const std::function<void()>& happens) {
    happens();
    said.push_back(name);
    for (FakeNode* sender : {&near, &far})
      rig.send(*sender, HubRig::group(5), said.back(), service_);
    rig.turn_shard(0);
    rig.turn_shard(1);
  }

  HubRig rig{2};
  FakeNode& provider = rig.join(0, kResume);
  FakeNode& near = rig.join(0);
  FakeNode& far = rig.join(1);
  std::vector<std::string> said;

 private:
  const FrameSpec service_;
};

TEST(RenumberedProvider, GetsAllThatIsSentToItsService) {
  for (const Policy policy : {Policy::kind_default, Policy::block, Policy::drop}) {
    SCOPED_TRACE(static_cast<int>(policy));
    RenumberedReceiver world(policy);
    HubRig& rig = world.rig;
    FakeNode& provider = world.provider;
    const NodeId former = provider.id;
    const auto renumbered = make_id<NodeId>(rig.hub(), 400);
    world.step("before", [] {});
    world.step("the new id is published", [&] { rig.nodes().publish(400, place_of(provider)); });
    world.step("the former id is nobody's",
               [&] { rig.nodes().publish(index_of(former), NodePlace::renumbered()); });
    world.step("the shard hears of it", [&] {
      rig.command(0, RenumberCommand{provider.session, renumbered, "another id"});
    });
    world.step("the group is published", [&] { rig.publish_group(5, renumbered, {}, true); });
    provider.read();
    ASSERT_TRUE(provider.goodbye);
    provider.id = renumbered;
    world.step("it is back", [&] { rig.rejoin(provider, kResume); });
    rig.settle();
    std::vector<std::string> from_near;
    std::vector<std::string> from_far;
    for (const testing::GotFrame& frame : provider.frames) {
      (NodeId{frame.header.src} == world.near.id ? from_near : from_far).push_back(frame.text());
    }
    EXPECT_THAT(from_near, ElementsAreArray(world.said));
    EXPECT_THAT(from_far, ElementsAreArray(world.said));
    EXPECT_EQ(rig.ledger().dropped, 0u);
  }
}

}  // namespace
}  // namespace gimnet::hub
