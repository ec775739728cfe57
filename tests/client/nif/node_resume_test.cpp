#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <thread>

#include "client/nif/node.hpp"
#include "tests/client/nif/support/fake_hub.hpp"

// Nodes that dial again only to resume their session.

namespace gimnet::nif::test {
namespace {

/// Receives one thing, checks its type, and gives it back.
nif_incoming expect(nif_node* node, nif_incoming_type type) {
  nif_incoming in{};
  EXPECT_EQ(nif_receive(node, &in, 20'000), NIF_OK) << nif_error_text();
  EXPECT_EQ(in.type, static_cast<std::uint32_t>(type));
  nif_incoming copy = in;
  nif_release(&in);
  return copy;
}

/// A node that dials only to resume its session.
Connected connect_to_resume(FakeHub& hub, std::uint32_t grace_ms = 30'000) {
  nif_options options = default_options();
  options.no_reconnect = 1;
  options.resume = NIF_RESUME_ON;
  proto::Welcome welcome = make_welcome(1u << 20);
  welcome.grace_ms = grace_ms;
  return connect_to(hub, options, welcome);
}

TEST(NodeResume, WithoutReconnectASessionThatCanBeResumedGoesOn) {
  FakeHub hub;
  Connected connected = connect_to_resume(hub);
  nif_node* const node = connected.node.get();
  connected.hub.close();
  EXPECT_EQ(expect(node, NIF_DISCONNECTED).flags, 0);
  std::thread sending([node] { EXPECT_EQ(nif_send_to(node, kPeerId, "waits", 5), NIF_OK); });
  proto::Welcome welcome = make_welcome(1u << 20);
  welcome.resumed = true;
  connected.hub = hub.admit(welcome);
  EXPECT_EQ(expect(node, NIF_CONNECTED).flags & NIF_CONNECTED_RESUMED, NIF_CONNECTED_RESUMED);
  EXPECT_EQ(connected.hub.next_message()->payload(), "waits");
  sending.join();
}

TEST(NodeResume, WithoutReconnectAHubThatForgotTheSessionIsTheEnd) {
  FakeHub hub;
  Connected connected = connect_to_resume(hub);
  nif_node* const node = connected.node.get();
  std::thread sending([node] {
    std::string payload(3u << 20, 'x');  // it waits for its window
    EXPECT_EQ(nif_send_to(node, kPeerId, payload.data(), payload.size()), NIF_NOT_CONNECTED);
  });
  connected.hub.close();
  EXPECT_EQ(expect(node, NIF_DISCONNECTED).flags, 0);
  connected.hub = hub.admit(make_welcome(1u << 20));
  EXPECT_EQ(expect(node, NIF_DISCONNECTED).flags, NIF_DISCONNECTED_FOR_GOOD);
  sending.join();
  EXPECT_EQ(info_of(node).ended, 1);
  const auto last = connected.hub.next_message();
  ASSERT_TRUE(last);
  EXPECT_EQ(last->header.kind, proto::Kind::link) << "GOODBYE: the new session is not wanted";
  EXPECT_FALSE(connected.hub.next_message());
}

TEST(NodeResume, WithoutReconnectTheEndComesWithTheGraceTime) {
  FakeHub hub;
  Connected connected = connect_to_resume(hub, 50);
  connected.hub.close();
  EXPECT_EQ(expect(connected.node.get(), NIF_DISCONNECTED).flags, 0);
  const FakeConnection silent = hub.accept();
  EXPECT_EQ(expect(connected.node.get(), NIF_DISCONNECTED).flags, NIF_DISCONNECTED_FOR_GOOD);
}

TEST(NodeResume, WithoutReconnectTheEndComesWhereNobodyListensAnyMore) {
  std::optional<FakeHub> hub(std::in_place);
  Connected connected = connect_to_resume(*hub);
  hub.reset();
  connected.hub.close();
  EXPECT_EQ(expect(connected.node.get(), NIF_DISCONNECTED).flags, 0);
  EXPECT_EQ(expect(connected.node.get(), NIF_DISCONNECTED).flags, NIF_DISCONNECTED_FOR_GOOD);
}

}  // namespace
}  // namespace gimnet::nif::test
