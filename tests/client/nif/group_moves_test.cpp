#include "client/nif/group_moves.hpp"

#include <gtest/gtest.h>

#include <optional>

namespace gimnet::nif::test {
namespace {

class Message {
 public:
  explicit Message(std::uint32_t group) {
    message_.kind = NIF_GROUP;
    message_.to = group;
    EXPECT_FALSE(outgoing.read(message_));
  }
  [[nodiscard]] std::uint32_t group() const { return outgoing.parts().header.dst; }
  Outgoing outgoing;

 private:
  nif_outgoing message_ = NIF_OUTGOING_INIT;
};

std::uint32_t group_of_a_message_to(const GroupMoves& moves, std::uint32_t group) {
  Message message(group);
  moves.redirect(message.outgoing);
  return message.group();
}

TEST(GroupMoves, LeadFromTheFormerGroupToTheLast) {
  GroupMoves moves;
  EXPECT_EQ(group_of_a_message_to(moves, 1), 1u);
  moves.add({.former = 1, .now = 2});
  EXPECT_EQ(group_of_a_message_to(moves, 1), 2u);
  EXPECT_EQ(group_of_a_message_to(moves, 2), 2u);
  moves.add({.former = 2, .now = 0});
  EXPECT_TRUE(moves.refuses(2));
  EXPECT_EQ(group_of_a_message_to(moves, 2), 2u) << "it may come back";
  moves.add({.former = 2, .now = 3});
  EXPECT_EQ(group_of_a_message_to(moves, 2), 3u);
  moves.add({.former = 3, .now = 3});
  EXPECT_EQ(group_of_a_message_to(moves, 3), 3u);
  moves.forget(3);
  EXPECT_EQ(group_of_a_message_to(moves, 2), 2u);
}

TEST(GroupMoves, AGroupIsOfTheServiceThatHasIt) {
  GroupMoves moves;
  moves.add({.former = 1, .now = 2});
  moves.add({.former = 2, .now = 1, .reused = true});
  EXPECT_EQ(group_of_a_message_to(moves, 1), 1u);
  EXPECT_EQ(group_of_a_message_to(moves, 2), 2u);
  moves.add({.former = 3, .now = 4});
  moves.add({.former = 0, .now = 3});
  EXPECT_EQ(group_of_a_message_to(moves, 3), 3u) << "a service that is new";
}

TEST(GroupMoves, AMessageThatWaitsGoesWithTheServiceThatHadItsGroup) {
  GroupMoves moves;
  Message first(1);
  Message second(2);
  Message stays(3);
  std::optional<GroupMoves::Turn> first_turn(std::in_place, moves, first.outgoing);
  const GroupMoves::Turn second_turn(moves, second.outgoing);
  const GroupMoves::Turn third_turn(moves, stays.outgoing);
  for (int round = 0; round < 2; ++round) {
    moves.begin();
    moves.add({.former = 3, .now = 3});
    moves.add({.former = 1, .now = 2});
    moves.add({.former = 2, .now = 1, .reused = true});
    EXPECT_EQ(first.group(), round == 0 ? 2u : 1u);
    EXPECT_EQ(second.group(), round == 0 ? 1u : 2u);
    EXPECT_EQ(stays.group(), 3u);
  }
  moves.begin();
  moves.add({.former = 3, .now = 0});
  moves.add({.former = 1, .now = 3});
  EXPECT_TRUE(moves.refuses(stays.group())) << "though another one has the group by now";
  EXPECT_FALSE(moves.refuses(3));
  EXPECT_EQ(first.group(), 3u);
  first_turn.reset();
  moves.begin();
  moves.add({.former = 3, .now = 9});
  moves.add({.former = 2, .now = 8});
  EXPECT_EQ(first.group(), 3u);
  EXPECT_EQ(second.group(), 8u);
  EXPECT_EQ(second.outgoing.stream(), Message(8).outgoing.stream()) << "pauses are for the group";
}

}  // namespace
}  // namespace gimnet::nif::test
