#include "client/gimi/connection_events.hpp"

#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <string>
#include <thread>

namespace gimnet::gimi {
namespace {

constexpr Timeout kPatience{20'000};

TEST(ConnectionEvents, BeginWithWhatWasToldLast) {
  ConnectionEvents events;
  events.tell(ConnectionChange::connected, "robot", "connected to the hub h");
  events.tell(ConnectionChange::lost, "robot", "lost the connection to the hub: it broke");
  const auto queue = events.begin();
  events.tell(ConnectionChange::resumed, "robot", "the hub is back");
  const auto first = queue->receive(kNoWait).or_throw();
  EXPECT_EQ(first.change, ConnectionChange::lost);
  EXPECT_EQ(first.why, "lost the connection to the hub: it broke");
  EXPECT_FALSE(first.is_connected());
  EXPECT_GT(first.when_ns, 0);
  const auto second = queue->receive(kNoWait).or_throw();
  EXPECT_EQ(second.change, ConnectionChange::resumed);
  EXPECT_TRUE(second.is_connected());
  EXPECT_EQ(second.skipped, 0u);
  EXPECT_TRUE(queue->receive(kNoWait).is(Status::timeout));
}

TEST(ConnectionEvents, GoToEachReaderUntilItLeaves) {
  ConnectionEvents events;
  const auto leaves = events.begin();
  const auto stays = events.begin();
  EXPECT_TRUE(leaves->receive(kNoWait));
  EXPECT_TRUE(stays->receive(kNoWait));
  events.remove(leaves);
  std::thread waits([&] {
    const auto told = stays->receive(kPatience);
    EXPECT_TRUE(told && told->change == ConnectionChange::lost);
  });
  events.tell(ConnectionChange::lost, "robot", "it broke");
  waits.join();
  EXPECT_TRUE(leaves->receive(kNoWait).is(Status::timeout));
}

TEST(ConnectionEvents, OfOneWhoDoesNotReadTheOldestGoAndAreCounted) {
  ConnectionEvents events;
  const auto queue = events.begin();
  constexpr std::size_t kMore = 3;
  for (std::size_t i = 1; i < ConnectionQueue::kEventsMax + kMore; ++i)
    events.tell(ConnectionChange::lost, "robot", std::to_string(i));
  const auto oldest = queue->receive(kNoWait).or_throw();
  EXPECT_EQ(oldest.why, std::to_string(kMore));
  EXPECT_EQ(oldest.skipped, kMore);
  std::size_t left = 0;
  while (const auto event = queue->receive(kNoWait)) {
    EXPECT_EQ(event->skipped, 0u);
    ++left;
  }
  EXPECT_EQ(left, ConnectionQueue::kEventsMax - 1);
}

TEST(ConnectionEvents, TellTheEndAfterTheEvents) {
  ConnectionEvents events;
  const auto queue = events.begin();
  const auto set = std::make_shared<WaitSet>();
  queue->visit([&](WaitSource& source, bool ready) {
    EXPECT_TRUE(source.join(set, {queue.get(), 1, 7}, ready));
  });
  std::array<gimi_ready, 4> ready{};
  EXPECT_EQ(*set->wait(ready, kNoWait), 1u);
  EXPECT_TRUE(queue->receive(kNoWait));
  EXPECT_TRUE(set->wait(ready, kNoWait).is(Status::timeout));
  events.tell(ConnectionChange::ended, "robot", "no connection will come any more: kicked");
  events.end({Status::refused, "kicked"});
  events.end(Ending::closed());
  EXPECT_EQ(queue->receive(kNoWait)->change, ConnectionChange::ended);
  EXPECT_TRUE(queue->receive(kNoWait).is(Status::refused)) << "the first reason stays";
  EXPECT_EQ(*set->wait(ready, kNoWait), 1u) << "the end is told for ever";
  EXPECT_EQ(ready[0].user, 7u);
  const auto late = events.begin();
  EXPECT_EQ(late->receive(kNoWait)->change, ConnectionChange::ended);
  EXPECT_TRUE(late->receive(kPatience).is(Status::refused));
}

}  // namespace
}  // namespace gimnet::gimi
