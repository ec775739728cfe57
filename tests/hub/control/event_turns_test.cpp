#include "hub/control/event_turns.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace gimnet::hub {
namespace {

using ::testing::ElementsAre;

/// Events of nodes a, b, c..., each with a number.
class EventTurnsTest : public ::testing::Test {
 protected:
  static SessionRef session(char node) {
    return {ConnectionSlot{static_cast<std::uint32_t>(node)}, 1};
  }
  void ask(char node, std::uint32_t number) {
    turns_.put({ShardIndex{0}, ControlFrameEvent{session(node), number, {}, {}}});
  }
  void end(char node, std::uint32_t number) {
    turns_.put({ShardIndex{0}, DetachedEvent{session(node), number, {}, false, {}, {}}});
  }
  /// A frame of the link to hub 9.
  void say(proto::Kind kind, std::uint32_t attachment, std::size_t size = proto::kHeaderSize) {
    ControlFrameEvent event{session('l'), attachment, make_id<NodeId>(HubId{9}, kHubIndex), {}};
    event.frame.resize(size);
    proto::FrameHeader header;
    header.kind = kind;
    proto::store_header(event.frame.data(), header);
    turns_.put({ShardIndex{0}, std::move(event)});
  }
  static std::string name(const ShardEvent& event) {
    const auto text = [](const char* what, const auto& one) {
      return what + std::string(1, static_cast<char>(one.session.slot.value())) +
             std::to_string(one.attachment);
    };
    if (const auto* frame = std::get_if<ControlFrameEvent>(&event.what)) return text("", *frame);
    if (const auto* ended = std::get_if<DetachedEvent>(&event.what)) return text("end ", *ended);
    return "drained";
  }
  std::vector<std::string> rest() {
    std::vector<std::string> names;
    while (!turns_.empty()) names.push_back(name(turns_.take()));
    return names;
  }

  EventTurns turns_;
};

TEST_F(EventTurnsTest, NodesTakeTurnsAndEachKeepsItsOrder) {
  for (std::uint32_t number = 1; number <= 3; ++number) ask('a', number);
  for (std::uint32_t number = 1; number <= 2; ++number) ask('b', number);
  ask('c', 1);
  EXPECT_THAT(rest(), ElementsAre("a1", "b1", "c1", "a2", "b2", "a3"));
}

TEST_F(EventTurnsTest, ANewcomerWaitsForOneOfEachOtherNode) {
  for (std::uint32_t number = 1; number <= 9; ++number) ask('a', number);
  EXPECT_EQ(name(turns_.take()), "a1");
  ask('b', 1);
  EXPECT_EQ(name(turns_.take()), "a2");
  EXPECT_EQ(name(turns_.take()), "b1");
}

TEST_F(EventTurnsTest, SessionsOfOneSlotAndOfOtherShardsAreApart) {
  turns_.put({ShardIndex{0}, ControlFrameEvent{{ConnectionSlot{'a'}, 1}, 1, {}, {}}});
  turns_.put({ShardIndex{0}, ControlFrameEvent{{ConnectionSlot{'a'}, 1}, 2, {}, {}}});
  turns_.put({ShardIndex{0}, ControlFrameEvent{{ConnectionSlot{'a'}, 2}, 3, {}, {}}});
  turns_.put({ShardIndex{1}, ControlFrameEvent{{ConnectionSlot{'a'}, 1}, 4, {}, {}}});
  EXPECT_THAT(rest(), ElementsAre("a1", "a3", "a4", "a2"));
}

TEST_F(EventTurnsTest, WhoseConnectionEndedNeedsNoTurn) {
  for (std::uint32_t number = 1; number <= 2; ++number) ask('a', number);
  ask('b', 1);
  end('b', 2);
  std::vector<std::string> names;
  for (const ShardEvent& event : turns_.take_ended()) names.push_back(name(event));
  EXPECT_THAT(names, ElementsAre("b1", "end b2"));
  EXPECT_TRUE(turns_.take_ended().empty());
  EXPECT_THAT(rest(), ElementsAre("a1", "a2"));
  end('a', 3);
  EXPECT_THAT(rest(), ElementsAre("end a3"));
  EXPECT_TRUE(turns_.take_ended().empty());
}

TEST_F(EventTurnsTest, RouteFramesOfALinkGoWithItsConnection) {
  for (int i = 0; i < 10; ++i) say(proto::Kind::route, 1);
  say(proto::Kind::ns, 1);
  end('l', 1);
  say(proto::Kind::route, 2);
  EXPECT_THAT(rest(), ElementsAre("l1", "end l1", "l2"));
}

TEST_F(EventTurnsTest, ALinkThatSaysTooMuchLosesFramesAndKeepsItsEnd) {
  constexpr std::size_t kSize = 65'536;
  constexpr std::uint32_t kRoom = EventTurns::kLinkBytesMax / (kSize + 256);
  for (std::uint32_t i = 1; i <= kRoom; ++i) say(proto::Kind::route, i, kSize);
  EXPECT_FALSE(turns_.take_overrun());
  for (int i = 0; i < 1'000; ++i) say(proto::Kind::ns, 999, kSize);
  EXPECT_EQ(turns_.take_overrun(), HubId{9});
  EXPECT_FALSE(turns_.take_overrun());
  EXPECT_EQ(turns_.take_dropped(), 1'000u);
  EXPECT_EQ(turns_.take_dropped(), 0u);
  EXPECT_EQ(name(turns_.take()), "l1");
  say(proto::Kind::ns, 1'000, kSize);
  EXPECT_FALSE(turns_.take_overrun()) << "one was worked off";
  end('l', 1'001);
  EXPECT_THAT(rest(), ElementsAre("l1000", "end l1001"));
  for (std::uint32_t i = 1; i <= kRoom; ++i) say(proto::Kind::ns, i, kSize);
  EXPECT_FALSE(turns_.take_overrun()) << "all was worked off";
}

TEST_F(EventTurnsTest, TheEndOfAShardComesLast) {
  turns_.put({ShardIndex{0}, DrainedEvent{}});
  ask('a', 1);
  EXPECT_THAT(rest(), ElementsAre("a1", "drained"));
}

}  // namespace
}  // namespace gimnet::hub
