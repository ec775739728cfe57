#include "client/gimi/ping_table.hpp"

#include <gtest/gtest.h>

#include <thread>

#include "client/gimi/ending.hpp"

namespace gimnet::gimi {
namespace {

constexpr Peer kPeer{3};

TEST(PingTable, MeasuresTheRoundTrip) {
  PingTable pings;
  pings.expect(1, kPeer);
  pings.on_pong(1, kPeer);
  const auto answer = pings.wait(1, INT64_MAX, kForever);
  ASSERT_TRUE(answer);
  EXPECT_GE(answer->round_trip_ns, 0);
  EXPECT_TRUE(answer->way_back.empty());
}

TEST(PingTable, KeepsTheWayOfAnAnswer) {
  PingTable pings;
  pings.expect(1, kPeer);
  pings.on_pong(1, kPeer, {{7, 100, 140}, {8, 200, 260}});
  const auto answer = pings.wait(1, INT64_MAX, kForever);
  ASSERT_TRUE(answer);
  ASSERT_EQ(answer->way_back.size(), 2u);
  EXPECT_EQ(answer->way_back[1].hub_id, 8u);
  EXPECT_EQ(answer->way_back[1].departure_ns, 260);
}

TEST(PingTable, TakesNoAnswerOfAnother) {
  PingTable pings;
  pings.expect(1, kPeer);
  pings.on_pong(1, Peer{4});
  pings.on_pong(2, kPeer);
  EXPECT_TRUE(pings.wait(1, deadline_after(Timeout{1}), Timeout{1}).is(Status::timeout));
}

TEST(PingTable, SaysWhyThereIsNoAnswer) {
  PingTable pings;
  pings.expect(1, kPeer);
  pings.on_lost(1, {Status::not_delivered, "no such node"});
  const auto answer = pings.wait(1, INT64_MAX, kForever);
  EXPECT_TRUE(answer.is(Status::not_delivered));
  EXPECT_NE(answer.failure().sentence.find("no such node"), std::string::npos);
}

TEST(PingTable, ClosingEndsAllWaits) {
  PingTable pings;
  pings.expect(1, kPeer);
  std::thread waiter([&] { EXPECT_TRUE(pings.wait(1, INT64_MAX, kForever).is(Status::closed)); });
  pings.end(Ending::closed());
  waiter.join();
}

TEST(PingTable, ForgetsWhatWasNotSent) {
  PingTable pings;
  pings.expect(1, kPeer);
  pings.forget(1);
  EXPECT_FALSE(pings.wait(1, INT64_MAX, kForever));
}

}  // namespace
}  // namespace gimnet::gimi
