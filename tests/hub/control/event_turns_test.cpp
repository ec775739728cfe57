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

TEST_F(EventTurnsTest, TheEndOfAShardComesLast) {
  turns_.put({ShardIndex{0}, DrainedEvent{}});
  ask('a', 1);
  EXPECT_THAT(rest(), ElementsAre("a1", "drained"));
}

}  // namespace
}  // namespace gimnet::hub
