#include "client/nif/send_gate.hpp"

#include <gtest/gtest.h>

#include <cstdint>

#include "tests/client/nif/support/frames.hpp"

namespace gimnet::nif::test {
namespace {

constexpr std::uint32_t kGroup = 11;

Outgoing message_to(std::uint32_t to, nif_kind kind = NIF_UNICAST,
                    nif_policy policy = NIF_POLICY_DEFAULT) {
  nif_outgoing given = NIF_OUTGOING_INIT;
  given.kind = static_cast<std::uint8_t>(kind);
  given.policy = static_cast<std::uint8_t>(policy);
  given.to = to;
  Outgoing message;
  EXPECT_FALSE(message.read(given));
  return message;
}

struct Gated {
  PauseTable pauses;
  GroupMoves moves;
  SendQueue queue{{.queue_bytes = 100}};
  SendGate gate{pauses, moves, queue};
};

TEST(SendGate, HoldsAPausedDestinationAndNoOther) {
  Gated at;
  at.pauses.pause({proto::Kind::unicast, proto::Lane::normal, 5}, 0);
  EXPECT_FALSE(at.gate.lets_in(message_to(5), 16));
  EXPECT_TRUE(at.gate.lets_in(message_to(6), 16));
}

TEST(SendGate, HoldsMessagesToGroupsWhileServicesAreDeclared) {
  Gated at;
  at.moves.begin();
  EXPECT_FALSE(at.gate.lets_in(message_to(kGroup, NIF_GROUP), 16));
  EXPECT_TRUE(at.gate.lets_in(message_to(5), 16));
  at.moves.end();
  EXPECT_TRUE(at.gate.lets_in(message_to(kGroup, NIF_GROUP), 16));
}

TEST(SendGate, HoldsAMessageForWhichTheQueueHasNoRoomUnlessItReplacesAnother) {
  Gated at;
  const Outgoing latest = message_to(kGroup, NIF_GROUP, NIF_LATEST);
  const auto stream = latest_stream_of(latest.parts().header, latest.parts().key);
  static_cast<void>(at.queue.append_latest(latest.parts().header.lane, 60, stream));
  EXPECT_FALSE(at.gate.lets_in(message_to(5), 60));
  EXPECT_FALSE(at.gate.lets_in(message_to(12, NIF_GROUP, NIF_LATEST), 60));
  EXPECT_TRUE(at.gate.lets_in(latest, 60));
}

TEST(SendGate, RefusesTheServicesThatTheHubRefuses) {
  Gated at;
  at.moves.add({{kGroup, 0}});
  EXPECT_TRUE(at.gate.refuses(message_to(kGroup, NIF_GROUP)));
  EXPECT_FALSE(at.gate.refuses(message_to(12, NIF_GROUP)));
  EXPECT_FALSE(at.gate.refuses(message_to(kGroup))) << "a node";
  at.moves.begin();
  EXPECT_FALSE(at.gate.refuses(message_to(kGroup, NIF_GROUP))) << "it may take it this time";
}

}  // namespace
}  // namespace gimnet::nif::test
