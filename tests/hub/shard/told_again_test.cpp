#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/shard/support/hub_rig.hpp"

// Tests the words that a node gets at its return, before all that waits for it.

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

/// A node that reads nothing, and a control queue of which the half is eight events.
class MissedEvents : public ::testing::Test {
 protected:
  static constexpr std::size_t kEventBytes = 1024;
  static Limits limits() {
    Limits limits;
    limits.control_bytes = 16 * kEventBytes;
    return limits;
  }
  void say_events(int count) {
    for (int i = 0; i < count; ++i) {
      TellCommand command;
      command.frame = event_for(node, kEventBytes - proto::kHeaderSize);
      command.to = {{node.session, node.id}};
      rig.command(0, std::move(command));
    }
    rig.turn();
  }
  std::size_t asked() {
    std::size_t count = 0;
    for (const ShardEvent& event : rig.take_events()) {
      const auto* missed = std::get_if<EventsMissedEvent>(&event.what);
      if (missed == nullptr) continue;
      ++count;
      EXPECT_EQ(missed->node, node.id);
      EXPECT_EQ(missed->attachment, rig.connection(node)->attachment);
    }
    return count;
  }
  std::ptrdiff_t read_events() {
    rig.settle();
    const auto count = std::ranges::count(node.kinds, Kind::ns);
    node.kinds.clear();
    return count;
  }
  void fill(int count) {
    node.pipe.set_room(0);
    say_events(count);
  }
  void read_all() { node.pipe.set_room(1 << 20); }

  HubRig rig{1, limits()};
  FakeNode& node = rig.join(0);
};

TEST_F(MissedEvents, EventsFillHalfOfTheControlQueueAndOneMoreIsDropped) {
  fill(8);
  read_all();
  EXPECT_EQ(read_events(), 8);
  EXPECT_EQ(asked(), 0u);
  fill(9);
  EXPECT_EQ(asked(), 0u) << "not before the queue is empty";
  read_all();
  EXPECT_EQ(read_events(), 8);
  EXPECT_EQ(asked(), 1u);
  EXPECT_FALSE(node.goodbye);
}

TEST_F(MissedEvents, EventsAreDroppedUntilTheNodeIsToldAgain) {
  fill(9);
  read_all();
  EXPECT_EQ(read_events(), 8);
  say_events(3);
  EXPECT_EQ(read_events(), 0) << "what comes after them may contradict what was missed";
  EXPECT_EQ(asked(), 1u) << "once";
  rig.command(0, TellAgainCommand{node.session, rig.connection(node)->attachment + 1, {}});
  say_events(1);
  EXPECT_EQ(read_events(), 0) << "that was for another connection";
  rig.command(0, TellAgainCommand{node.session, rig.connection(node)->attachment,
                                  event_for(node, 64 * 1024)});
  say_events(1);
  EXPECT_EQ(read_events(), 2);
  EXPECT_FALSE(node.goodbye);
}

TEST_F(MissedEvents, ANewConnectionMissesNothing) {
  fill(9);
  rig.rejoin(node);
  say_events(1);
  EXPECT_EQ(read_events(), 1);
  EXPECT_EQ(asked(), 0u);
}

TEST_F(MissedEvents, APaceDoesNotBeginWithAnEventThatWasDropped) {
  const auto pace = [this](bool with_event) {
    PaceCommand command;
    command.session = node.session;
    command.group = GroupId{HubRig::group(kGroup)};
    command.terms = {.window = 2};
    command.with_event = with_event;
    rig.command(0, std::move(command));
    rig.turn();
    return Pacer::find(*rig.connection(node), GroupId{HubRig::group(kGroup)}) != nullptr;
  };
  fill(9);
  EXPECT_FALSE(pace(true)) << "the node does not know the group: it would not count what comes";
  EXPECT_TRUE(pace(false)) << "of an answer";
}

}  // namespace
}  // namespace gimnet::hub
