#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/shard/support/hub_rig.hpp"

// What a node is told at its return, before all that waits for it.

namespace gimnet::hub {
namespace {

using proto::Kind;
using ::testing::ElementsAre;
using testing::FakeNode;
using testing::HubRig;

constexpr std::uint32_t kGroup = 5;

std::vector<std::byte> event_for(const FakeNode& node, std::size_t bytes = 8) {
  return HubRig::frame(node, node.id.value(), std::string(bytes, 'e'),
                       {.kind = Kind::ns, .src = 7u << 20});
}

TEST(ToldAgain, StandsBeforeWhatIsSentAgainAndWhatWaits) {
  HubRig rig;
  FakeNode& provider = rig.join(0);
  FakeNode& subscriber = rig.join(0, {.resume = true});
  rig.publish_group(kGroup, provider.id, {&subscriber});
  rig.send(provider, HubRig::group(kGroup), "lost on the way", {.kind = Kind::group});
  rig.settle_without_reading();
  subscriber.pipe.close();
  rig.settle_without_reading();
  rig.send(provider, HubRig::group(kGroup), "while away", {.kind = Kind::group});
  rig.settle_without_reading();
  subscriber.kinds.clear();
  const auto event = event_for(subscriber);
  rig.rejoin(subscriber, {.resume = true, .told = event});
  rig.settle();
  ASSERT_TRUE(subscriber.welcome->resumed);
  EXPECT_THAT(subscriber.texts(), ElementsAre("lost on the way", "while away"));
  EXPECT_THAT(subscriber.kinds, ElementsAre(Kind::link, Kind::ns, Kind::group, Kind::group));
}

TEST(ToldAgain, ANodeThatIsToldMuchMayAskAllTheSame) {
  Limits limits;
  limits.control_bytes = 16 * 1024;
  HubRig rig(1, limits);
  FakeNode& node = rig.join(0);
  std::vector<std::byte> events;
  for (int i = 0; i < 100; ++i) {
    const auto event = event_for(node, 1024);
    events.insert(events.end(), event.begin(), event.end());
  }
  node.kinds.clear();
  rig.rejoin(node, {.told = events});
  SendControlCommand command;
  command.session = node.session;
  command.frame = event_for(node);
  rig.command(0, std::move(command));
  rig.settle();
  EXPECT_EQ(std::ranges::count(node.kinds, Kind::ns), 101);
  EXPECT_FALSE(node.goodbye);
}

TEST(ToldAgain, OneEventGoesToEachOfManySessions) {
  HubRig rig;
  FakeNode& one = rig.join(0);
  FakeNode& other = rig.join(0);
  TellCommand command;
  command.frame = event_for(one);
  for (const FakeNode* node : {&one, &other}) command.to.push_back({node->session, node->id});
  command.to.push_back({{ConnectionSlot{77}, 1}, NodeId{77}});  // it left meanwhile
  rig.command(0, std::move(command));
  rig.settle();
  for (FakeNode* node : {&one, &other}) EXPECT_EQ(std::ranges::count(node->kinds, Kind::ns), 1);
}

}  // namespace
}  // namespace gimnet::hub
