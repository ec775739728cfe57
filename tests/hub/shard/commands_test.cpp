#include "hub/shard/commands.hpp"

#include <gtest/gtest.h>

#include <array>

namespace gimnet::hub {
namespace {

ShardEvent event_of(std::uint8_t shard) { return {ShardIndex{shard}, DrainedEvent{}}; }

TEST(ControlInbox, GivesABatchOrLess) {
  ControlInbox inbox(2);
  for (int i = 0; i < 10; ++i) inbox.push(event_of(1));
  EXPECT_EQ(inbox.drain(9, [](const ShardEvent&) {}), 9u);
  EXPECT_FALSE(inbox.empty());
  EXPECT_EQ(inbox.drain(9, [](const ShardEvent&) {}), 1u);
  EXPECT_TRUE(inbox.empty());
}

TEST(ControlInbox, GivesAllThatIsThereAndEndsThoughMoreComes) {
  ControlInbox inbox(3);
  constexpr std::size_t kEach = 5'000;
  for (std::size_t i = 0; i < kEach; ++i) {
    inbox.push(event_of(0));
    inbox.push(event_of(2));
  }
  inbox.drain(100, [](const ShardEvent&) {});
  std::array<std::size_t, 3> taken{};
  inbox.drain_present([&](const ShardEvent& event) {
    ++taken[event.shard.value()];
    inbox.push(event_of(1));
    inbox.push(event_of(0));
  });
  EXPECT_GE(taken[0] + taken[2], 2 * kEach - 100);
  EXPECT_GE(taken[0], kEach - 100);
  EXPECT_GE(taken[2], kEach - 100);
  EXPECT_LE(taken[2], kEach);
  EXPECT_FALSE(inbox.empty());
}

TEST(ControlInbox, GivesNothingWhereNothingIs) {
  ControlInbox inbox(2);
  inbox.drain_present([](const ShardEvent&) { FAIL(); });
  inbox.push(event_of(0));
  inbox.drain(1, [](const ShardEvent&) {});
  inbox.drain_present([](const ShardEvent&) { FAIL(); });
}

}  // namespace
}  // namespace gimnet::hub
