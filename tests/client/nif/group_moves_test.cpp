#include "client/nif/group_moves.hpp"

#include <gtest/gtest.h>

#include "client/nif/send_queue.hpp"

namespace gimnet::nif {
namespace {

/// The destination of a message of that kind to `to`, after the moves.
std::uint32_t destination_of(const GroupMoves& moves, std::uint32_t to, nif_kind kind = NIF_GROUP) {
  nif_outgoing given = NIF_OUTGOING_INIT;
  given.kind = static_cast<std::uint8_t>(kind);
  given.to = to;
  Outgoing message;
  EXPECT_FALSE(message.read(given));
  moves.redirect(message);
  return message.parts().header.dst;
}

TEST(GroupMoves, LeadsFromTheFormerGroupToTheNewOne) {
  GroupMoves moves;
  EXPECT_EQ(destination_of(moves, 5), 5u);
  moves.add({{5, 9}, {6, 6}});
  EXPECT_EQ(destination_of(moves, 5), 9u);
  EXPECT_EQ(destination_of(moves, 6), 6u);
  EXPECT_EQ(destination_of(moves, 9), 9u);
  EXPECT_EQ(destination_of(moves, 5, NIF_UNICAST), 5u) << "a node";
}

TEST(GroupMoves, LeadsFromEachFormerGroupToTheLastOne) {
  GroupMoves moves;
  moves.add({{5, 9}});
  moves.add({{9, 12}});
  EXPECT_EQ(destination_of(moves, 5), 12u);
  EXPECT_EQ(destination_of(moves, 9), 12u);
}

TEST(GroupMoves, AGroupThatAServiceHasNowIsNoFormerOneAnyMore) {
  GroupMoves moves;
  moves.add({{5, 9}});
  moves.add({{9, 5}});
  EXPECT_EQ(destination_of(moves, 5), 5u);
  EXPECT_EQ(destination_of(moves, 9), 5u);
}

TEST(GroupMoves, RefusesAServiceThatTheHubRefusesUntilItTakesItAgain) {
  GroupMoves moves;
  EXPECT_TRUE(moves.refuses(0)) << "no group";
  EXPECT_FALSE(moves.refuses(5));
  moves.add({{5, 0}});
  EXPECT_TRUE(moves.refuses(5));
  EXPECT_EQ(destination_of(moves, 5), 5u) << "it goes nowhere else";
  moves.add({{5, 9}});
  EXPECT_FALSE(moves.refuses(5));
  EXPECT_EQ(destination_of(moves, 5), 9u);
}

TEST(GroupMoves, ForgetsAGroupFromEitherEnd) {
  GroupMoves moves;
  moves.add({{5, 9}, {6, 10}});
  moves.forget(5);
  moves.forget(10);
  EXPECT_EQ(destination_of(moves, 5), 5u);
  EXPECT_EQ(destination_of(moves, 6), 6u);
}

TEST(GroupMoves, IsSettledButWhileServicesAreDeclared) {
  GroupMoves moves;
  EXPECT_TRUE(moves.settled());
  moves.begin();
  EXPECT_FALSE(moves.settled());
  moves.end();
  EXPECT_TRUE(moves.settled());
}

}  // namespace
}  // namespace gimnet::nif
