#include <gtest/gtest.h>

#include <cstdint>
#include <optional>
#include <thread>

#include "client/nif/outbound.hpp"
#include "tests/client/nif/support/fake_hub.hpp"

// nif_drain(): what was sent is written, and confirmed where the hub confirms.

namespace gimnet::nif::test {
namespace {

TEST(OutboundDrain, WaitsForWritingAndConfirmation) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options("robot"), make_welcome(1u << 20));
  ASSERT_EQ(info_of(connected.node.get()).resume, 1);
  ASSERT_EQ(nif_send_to(connected.node.get(), kPeerId, "a", 1), NIF_OK);
  EXPECT_EQ(nif_drain(connected.node.get(), 0), NIF_TIMEOUT);
  std::thread draining([&] { EXPECT_EQ(nif_drain(connected.node.get(), NIF_FOREVER), NIF_OK); });
  ASSERT_TRUE(connected.hub.next_message());
  connected.hub.send(proto::flow::Confirm{1});
  draining.join();
  EXPECT_EQ(counters_of(connected.node.get()).retained_bytes, 0u);
}

/// The keep-alive of these hubs is an hour, so a PING is the question of a nif_drain().
std::optional<proto::flow::Ping> next_question(FakeConnection& hub) {
  return hub.next_flow<proto::flow::Ping>();
}

TEST(OutboundDrain, AsksForAConfirmAndAgainWhereThatWasNotAll) {
  FakeHub hub;
  proto::Welcome welcome = make_welcome(1u << 20);
  welcome.keep_alive_ms = welcome.silent_ms = 3'600'000;
  Connected connected = connect_to(hub, default_options("robot"), welcome);
  nif_node* const node = connected.node.get();
  ASSERT_EQ(nif_drain(node, 0), NIF_OK) << "nothing to ask for";
  ASSERT_EQ(nif_send_to(node, kPeerId, "a", 1), NIF_OK);
  EXPECT_EQ(nif_drain(node, 0), NIF_TIMEOUT);
  EXPECT_EQ(nif_drain(node, 0), NIF_TIMEOUT);
  ASSERT_TRUE(connected.hub.next_message());
  EXPECT_TRUE(next_question(connected.hub)) << "behind what it asks about";
  ASSERT_EQ(nif_send_to(node, kPeerId, "b", 1), NIF_OK);
  std::thread draining([&] { EXPECT_EQ(nif_drain(node, NIF_FOREVER), NIF_OK); });
  const auto second = connected.hub.next();
  ASSERT_TRUE(second);
  EXPECT_EQ(second->header.kind, proto::Kind::unicast)
      << "asked once, however often nif_drain() is called";
  connected.hub.send(proto::flow::Confirm{1});
  EXPECT_TRUE(next_question(connected.hub)) << "the answer was not about all that was sent";
  connected.hub.send(proto::flow::Confirm{2});
  draining.join();
}

TEST(OutboundDrain, AsksTheNewConnectionAfterAResume) {
  FakeHub hub;
  proto::Welcome welcome = make_welcome(1u << 20);
  welcome.keep_alive_ms = welcome.silent_ms = 3'600'000;
  Connected connected = connect_to(hub, default_options("robot"), welcome);
  nif_node* const node = connected.node.get();
  ASSERT_EQ(nif_send_to(node, kPeerId, "a", 1), NIF_OK);
  std::thread draining([&] { EXPECT_EQ(nif_drain(node, NIF_FOREVER), NIF_OK); });
  EXPECT_TRUE(next_question(connected.hub));
  connected.hub.close();
  welcome.resumed = true;
  connected.hub = hub.admit(welcome);
  EXPECT_TRUE(next_question(connected.hub)) << "the question went with the connection";
  connected.hub.send(proto::flow::Confirm{1});
  draining.join();
}

TEST(OutboundDrain, TellsOnceThatTheHubForgotWhatItHadNotConfirmed) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options("robot"), make_welcome(1u << 20));
  ASSERT_EQ(nif_send_to(connected.node.get(), kPeerId, "a", 1), NIF_OK);
  ASSERT_TRUE(connected.hub.next_message());
  connected.hub.close();
  connected.hub = hub.admit(make_welcome(1u << 20));
  while (info_of(connected.node.get()).reconnects == 0) std::this_thread::yield();
  EXPECT_EQ(nif_drain(connected.node.get(), NIF_FOREVER), NIF_NOT_CONNECTED);
  EXPECT_EQ(nif_drain(connected.node.get(), NIF_FOREVER), NIF_OK);
}

TEST(OutboundDrain, TellsOnceThatFramesHadLeftTheResumeBuffer) {
  FakeHub hub;
  nif_options options = default_options("robot");
  options.resume_bytes = 64;
  proto::Welcome welcome = make_welcome(1u << 20);
  Connected connected = connect_to(hub, options, welcome);
  nif_node* const node = connected.node.get();
  nif_outgoing message = NIF_OUTGOING_INIT;
  message.to = kPeerId;
  message.policy = NIF_DROP;
  constexpr std::uint64_t kMessages = 20;
  for (std::uint64_t i = 0; i < kMessages; ++i) {
    ASSERT_EQ(nif_send(node, &message, NIF_FOREVER), NIF_OK);
    ASSERT_TRUE(connected.hub.next_message());
  }
  ASSERT_GT(counters_of(node).frames_let_go, 0u);
  connected.hub.close();
  welcome.resumed = true;
  connected.hub = hub.admit(welcome);
  while (info_of(node).reconnects == 0) std::this_thread::yield();
  EXPECT_EQ(nif_drain(node, 0), NIF_NOT_CONNECTED)
      << "the hub never had them, for all that this end knows";
  for (auto i = counters_of(node).frames_let_go; i < kMessages; ++i)
    ASSERT_TRUE(connected.hub.next_message());
  connected.hub.send(proto::flow::Confirm{kMessages});
  EXPECT_EQ(nif_drain(node, NIF_FOREVER), NIF_OK);
}

}  // namespace
}  // namespace gimnet::nif::test
