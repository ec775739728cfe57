#include "client/nif/node.hpp"

#include <gtest/gtest.h>

#include <string>
#include <thread>
#include <vector>

#include "tests/client/nif/support/fake_hub.hpp"

// Connecting, breaking, connecting again.

namespace gimnet::nif::test {
namespace {

constexpr std::uint32_t kResumeBytes = 1u << 20;

nif_incoming receive(nif_node* node) {
  nif_incoming in{};
  EXPECT_EQ(nif_receive(node, &in, 20'000), NIF_OK) << nif_error_text();
  return in;
}

/// Receives one thing, checks its type, and gives it back.
nif_incoming expect(nif_node* node, nif_incoming_type type) {
  nif_incoming in = receive(node);
  EXPECT_EQ(in.type, static_cast<std::uint32_t>(type));
  nif_incoming copy = in;
  nif_release(&in);
  return copy;
}

TEST(Node, TellsWhyAHubRefuses) {
  const std::pair<proto::GoodbyeCode, nif_status> cases[] = {
      {proto::GoodbyeCode::name_taken, NIF_NAME_TAKEN},
      {proto::GoodbyeCode::bad_name, NIF_BAD_NAME},
      {proto::GoodbyeCode::bad_version, NIF_BAD_VERSION},
      {proto::GoodbyeCode::hub_full, NIF_HUB_FULL},
      {proto::GoodbyeCode::draining, NIF_REFUSED},
      {static_cast<proto::GoodbyeCode>(999), NIF_REFUSED}};
  for (const auto& [code, status] : cases) {
    FakeHub hub;
    std::thread refusing([&hub, refusal = code] {
      FakeConnection connection = hub.accept();
      EXPECT_TRUE(connection.read_hello());
      connection.send(proto::kOpening);
      connection.goodbye(refusal, "go away");
    });
    const std::string url = hub.url();
    nif_options options = default_options("robot");
    options.url = url.c_str();
    nif_node* node = nullptr;
    EXPECT_EQ(nif_connect(&options, &node), status);
    EXPECT_EQ(node, nullptr);
    EXPECT_NE(std::string(nif_error_text()).find("go away"), std::string::npos) << nif_error_text();
    refusing.join();
  }
}

TEST(Node, TellsThatNobodyIsThere) {
  std::string url;
  {
    const FakeHub hub;
    url = hub.url();
  }
  nif_options options = default_options();
  options.url = url.c_str();
  nif_node* node = nullptr;
  EXPECT_EQ(nif_connect(&options, &node), NIF_NO_HUB);
  options.url = "unix:/nonexistent/gimnet/socket";
  EXPECT_EQ(nif_connect(&options, &node), NIF_NO_HUB);
}

TEST(Node, TellsThatAPeerIsNoHub) {
  for (const char* const answer :
       {"HTTP/1.1 400 Bad Request\r\n\r\n", "GIMnet\x02\x00 other version"}) {
    FakeHub hub;
    std::thread answering([&] {
      FakeConnection connection = hub.accept();
      EXPECT_TRUE(connection.read_hello());
      connection.send(std::as_bytes(std::span(std::string_view(answer, 20))));
      EXPECT_TRUE(connection.wait_closed());
    });
    const std::string url = hub.url();
    nif_options options = default_options();
    options.url = url.c_str();
    nif_node* node = nullptr;
    const nif_status status = nif_connect(&options, &node);
    EXPECT_TRUE(status == NIF_PROTOCOL || status == NIF_BAD_VERSION) << status;
    answering.join();
  }
}

TEST(Node, TimesOutWithAPeerThatSaysNothing) {
  FakeHub hub;
  const std::string url = hub.url();
  nif_options options = default_options();
  options.url = url.c_str();
  options.connect_timeout_ms = 30;
  nif_node* node = nullptr;
  EXPECT_EQ(nif_connect(&options, &node), NIF_TIMEOUT);
}

TEST(Node, ComesBackWithItsTokenAndIsToldSo) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options("robot"), make_welcome());
  EXPECT_TRUE(connected.hello.token.empty());
  connected.hub.close();
  proto::Hello hello;
  connected.hub = hub.admit(make_welcome(), &hello);
  EXPECT_EQ(hello.token, make_welcome().token);
  EXPECT_EQ(hello.name, "robot");
  static_cast<void>(expect(connected.node.get(), NIF_DISCONNECTED));
  EXPECT_EQ(expect(connected.node.get(), NIF_CONNECTED).flags, NIF_CONNECTED_SAME_ID);
  EXPECT_EQ(info_of(connected.node.get()).reconnects, 1u);
}

TEST(Node, ResumesInBothDirectionsWithoutLossOrRepeat) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options("robot"), make_welcome(kResumeBytes));
  nif_node* const node = connected.node.get();
  EXPECT_TRUE(connected.hello.resume);
  for (const char* text : {"0", "1", "2"}) ASSERT_EQ(nif_send_to(node, kPeerId, text, 1), NIF_OK);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(connected.hub.next_message());
  connected.hub.send_unicast(kPeerId, kOwnId, "a");
  EXPECT_EQ(expect(node, NIF_MESSAGE).size, 1u);
  connected.hub.close();
  // Only now is it sure that the next message does not go out on the connection that broke.
  static_cast<void>(expect(node, NIF_DISCONNECTED));
  std::thread sending([node] { EXPECT_EQ(nif_send_to(node, kPeerId, "3", 1), NIF_OK); });

  proto::Welcome welcome = make_welcome(kResumeBytes);
  welcome.resumed = true;
  welcome.taken = 1;  // of three: "1" and "2" got lost on the way
  proto::Hello hello;
  connected.hub = hub.admit(welcome, &hello);
  EXPECT_EQ(hello.epoch, connected.hello.epoch);
  EXPECT_EQ(hello.resume_epoch, welcome.epoch);
  EXPECT_EQ(hello.resume_taken, 1u);
  for (const char* text : {"1", "2", "3"}) {
    const auto frame = connected.hub.next_message();
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->payload(), text);
  }
  sending.join();
  EXPECT_EQ(expect(node, NIF_CONNECTED).flags, NIF_CONNECTED_RESUMED | NIF_CONNECTED_SAME_ID);
  while (counters_of(node).frames_resent < 2)
    std::this_thread::yield();  // counted behind the write
  EXPECT_EQ(counters_of(node).frames_resent, 2u);
}

TEST(Node, AnnouncesWhatItLetGo) {
  FakeHub hub;
  nif_options options = default_options("robot");
  options.resume_bytes = 1024;
  Connected connected = connect_to(hub, options, make_welcome(kResumeBytes));
  EXPECT_EQ(connected.hello.resume_buffer_bytes, 1024u);
  nif_outgoing message = NIF_OUTGOING_INIT;
  message.to = kPeerId;
  message.policy = NIF_DROP;
  constexpr std::uint64_t kMessages = 200;
  for (std::uint64_t i = 0; i < kMessages; ++i) {
    ASSERT_EQ(nif_send(connected.node.get(), &message, NIF_FOREVER), NIF_OK);
    ASSERT_TRUE(connected.hub.next_message());
  }
  connected.hub.close();
  proto::Welcome welcome = make_welcome(kResumeBytes);
  welcome.resumed = true;
  connected.hub = hub.admit(welcome);
  const auto skip = connected.hub.next_flow<proto::flow::Skip>();
  ASSERT_TRUE(skip);
  std::uint64_t again = 0;
  while (skip->count + again < kMessages) {
    ASSERT_TRUE(connected.hub.next_message());
    ++again;
  }
  EXPECT_LE(again, 1024u / 16);
  EXPECT_EQ(counters_of(connected.node.get()).frames_let_go, skip->count);
  static_cast<void>(expect(connected.node.get(), NIF_DISCONNECTED));
  static_cast<void>(expect(connected.node.get(), NIF_CONNECTED));
  const nif_incoming gap = expect(connected.node.get(), NIF_GAP);
  EXPECT_EQ(gap.from, kOwnId);
  EXPECT_EQ(gap.count, skip->count);
}

TEST(Node, StartsAnewWhereTheHubForgot) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options("robot"), make_welcome(kResumeBytes));
  nif_node* const node = connected.node.get();
  ASSERT_EQ(nif_send_to(node, kPeerId, "lost", 4), NIF_OK);
  ASSERT_TRUE(connected.hub.next_message());
  connected.hub.close();
  proto::Welcome welcome = make_welcome(kResumeBytes);
  welcome.node = NodeId{kOwnId + 5};
  welcome.epoch = 0x9999;
  connected.hub = hub.admit(welcome);
  static_cast<void>(expect(node, NIF_DISCONNECTED));
  EXPECT_EQ(expect(node, NIF_CONNECTED).flags, 0);
  EXPECT_EQ(nif_id(node), kOwnId + 5);
  ASSERT_EQ(nif_send_to(node, kPeerId, "new", 3), NIF_OK);
  const auto frame = connected.hub.next_message();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->payload(), "new");
  EXPECT_EQ(frame->header.src, kOwnId + 5);
}

TEST(Node, AHubWithImpossibleCountsIsDialedAfresh) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options("robot"), make_welcome(kResumeBytes));
  connected.hub.close();
  proto::Welcome welcome = make_welcome(kResumeBytes);
  welcome.resumed = true;
  welcome.taken = 1000;  // nothing was ever sent
  FakeConnection wrong = hub.admit(welcome);
  EXPECT_TRUE(wrong.wait_closed());
  proto::Hello hello;
  connected.hub = hub.admit(make_welcome(kResumeBytes), &hello);
  EXPECT_EQ(hello.resume_epoch, 0u);
  EXPECT_NE(hello.epoch, connected.hello.epoch);
}

TEST(Node, DoesNotComeBackWhenItWasReplaced) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options("robot"), make_welcome());
  nif_node* const node = connected.node.get();
  connected.hub.send_unicast(kPeerId, kOwnId, "before");
  connected.hub.goodbye(proto::GoodbyeCode::replaced, "a newer connection");
  static_cast<void>(expect(node, NIF_MESSAGE));
  nif_incoming in = receive(node);
  EXPECT_EQ(in.type, static_cast<std::uint32_t>(NIF_SESSION_REPLACED));
  EXPECT_NE(std::string(in.text).find("a newer connection"), std::string::npos);
  nif_release(&in);
  EXPECT_EQ(nif_receive(node, &in, NIF_FOREVER), NIF_REPLACED);
  EXPECT_EQ(nif_send_to(node, kPeerId, "", 0), NIF_REPLACED);
  EXPECT_EQ(info_of(node).replaced, 1);
  char sentence[256];
  EXPECT_GT(nif_last_error(node, sentence, sizeof sentence), 0u);
}

TEST(Node, DoesNotComeBackWhenItWasKicked) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options("robot"), make_welcome());
  nif_node* const node = connected.node.get();
  connected.hub.send_unicast(kPeerId, kOwnId, "before");
  connected.hub.goodbye(proto::GoodbyeCode::kicked, "it stands in the way");
  static_cast<void>(expect(node, NIF_MESSAGE));
  const nif_incoming last = expect(node, NIF_DISCONNECTED);
  EXPECT_EQ(last.flags, NIF_DISCONNECTED_FOR_GOOD);
  EXPECT_EQ(last.reason, static_cast<std::uint32_t>(proto::GoodbyeCode::kicked));
  nif_incoming in;
  EXPECT_EQ(nif_receive(node, &in, NIF_FOREVER), NIF_REFUSED);
  EXPECT_NE(std::string(nif_error_text()).find("it stands in the way"), std::string::npos)
      << nif_error_text();
  EXPECT_EQ(nif_send_to(node, kPeerId, "", 0), NIF_REFUSED);
  EXPECT_NE(std::string(nif_error_text()).find("it stands in the way"), std::string::npos)
      << nif_error_text();
  std::uint32_t id = 0;
  EXPECT_EQ(nif_resolve(node, "other", &id, NIF_FOREVER), NIF_REFUSED);
  EXPECT_EQ(info_of(node).ended, 1);
  EXPECT_EQ(info_of(node).connected, 0);
  // The next connection of the hub is another node's: this one has not dialed again.
  EXPECT_EQ(connect_to(hub, default_options("other"), make_welcome()).hello.name, "other");
}

TEST(Node, ARenumberedOneThatMayNotReconnectHasOneTry) {
  FakeHub hub;
  nif_options options = default_options("robot");
  options.no_reconnect = 1;
  Connected connected = connect_to(hub, options, make_welcome());
  connected.hub.goodbye(proto::GoodbyeCode::renumbered, "another id");
  FakeConnection again = hub.accept();
  ASSERT_TRUE(again.read_hello());
  EXPECT_EQ(expect(connected.node.get(), NIF_DISCONNECTED).flags, 0);
  EXPECT_EQ(info_of(connected.node.get()).ended, 0);
  again.send(proto::kOpening);
  again.goodbye(proto::GoodbyeCode::hub_full, "no room");
  EXPECT_EQ(expect(connected.node.get(), NIF_DISCONNECTED).flags, NIF_DISCONNECTED_FOR_GOOD);
  nif_incoming in;
  EXPECT_EQ(nif_receive(connected.node.get(), &in, NIF_FOREVER), NIF_HUB_FULL);
  EXPECT_EQ(info_of(connected.node.get()).ended, 1);
}

TEST(Node, WithoutReconnectCallsSayThatItIsOver) {
  FakeHub hub;
  nif_options options = default_options();
  options.no_reconnect = 1;
  Connected connected = connect_to(hub, options, make_welcome());
  connected.hub.close();
  static_cast<void>(expect(connected.node.get(), NIF_DISCONNECTED));
  nif_incoming in;
  EXPECT_EQ(nif_receive(connected.node.get(), &in, NIF_FOREVER), NIF_NOT_CONNECTED);
  EXPECT_EQ(nif_send_to(connected.node.get(), kPeerId, "", 0), NIF_NOT_CONNECTED);
}

TEST(Node, WithoutResumeASendFailsWhileBroken) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  connected.hub.close();
  static_cast<void>(expect(connected.node.get(), NIF_DISCONNECTED));
  FakeConnection silent = hub.accept();
  EXPECT_EQ(nif_send_to(connected.node.get(), kPeerId, "", 0), NIF_NOT_CONNECTED);
}

TEST(Node, DeclaresServicesAndSubscriptionsAgain) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options("robot"), make_welcome());
  nif_node* const node = connected.node.get();
  std::thread declaring([node] {
    nif_service service{};
    service.struct_size = sizeof service;
    service.name = "odom";
    service.message_type = 5;
    std::uint32_t group = 0;
    EXPECT_EQ(nif_advertise(node, &service, &group, nullptr, NIF_FOREVER), NIF_OK);
    EXPECT_EQ(group, 11u);
    EXPECT_EQ(nif_subscribe(node, "peer/scan", nullptr, NIF_FOREVER), NIF_OK);
  });
  const auto answer = [](FakeConnection& to, std::uint32_t own_group, std::uint32_t peer_group) {
    std::uint16_t number = 0;
    const auto advertise = to.next_request<proto::ns::Advertise>(number);
    ASSERT_TRUE(advertise);
    EXPECT_EQ(advertise->service, "odom");
    to.send_control(
        proto::Kind::ns,
        proto::encode_answer(proto::ns::AdvertiseAnswer{GroupId{own_group}, 0}, number));
    const auto subscribe = to.next_request<proto::ns::Subscribe>(number);
    ASSERT_TRUE(subscribe);
    EXPECT_EQ(subscribe->name, "peer/scan");
    proto::ns::SubscribeAnswer subscribed;
    subscribed.group = GroupId{peer_group};
    subscribed.provider = NodeId{kPeerId};
    to.send_control(proto::Kind::ns, proto::encode_answer(subscribed, number));
  };
  answer(connected.hub, 11, 21);
  declaring.join();
  connected.hub.close();
  connected.hub = hub.admit(make_welcome());
  answer(connected.hub, 12, 22);
  static_cast<void>(expect(node, NIF_DISCONNECTED));
  static_cast<void>(expect(node, NIF_CONNECTED));
  const nif_incoming own = expect(node, NIF_OWN_SERVICE_MOVED);
  EXPECT_EQ(own.former_group, 11u);
  EXPECT_EQ(own.group, 12u);
  EXPECT_EQ(expect(node, NIF_SUBSCRIBERS).group, 12u) << "how many there are now";
  const nif_incoming peer = expect(node, NIF_SERVICE_MOVED);
  EXPECT_EQ(peer.from, kPeerId);
  EXPECT_EQ(peer.group, 22u);
}

TEST(Node, MeasuresTheHubsClock) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  std::thread pinging([&] {
    std::int64_t round_trip = 0;
    std::int64_t offset = 0;
    EXPECT_EQ(nif_ping_hub(connected.node.get(), &round_trip, &offset, NIF_FOREVER), NIF_OK);
    EXPECT_GT(round_trip, 0);
    EXPECT_GT(offset, 3'500'000'000'000) << "the hub is an hour ahead";
  });
  constexpr std::int64_t kHourNs = 3'600'000'000'000;
  const auto ping = connected.hub.next_flow<proto::flow::Ping>();
  ASSERT_TRUE(ping);
  connected.hub.send(proto::flow::Pong{ping->sequence, ping->sent_ns, wall_now_ns() + kHourNs});
  while (info_of(connected.node.get()).keep_alive_seen == 0) std::this_thread::yield();
  const auto second = connected.hub.next_flow<proto::flow::Ping>();
  if (second)
    connected.hub.send(
        proto::flow::Pong{second->sequence, second->sent_ns, wall_now_ns() + kHourNs});
  pinging.join();
}

}  // namespace
}  // namespace gimnet::nif::test
