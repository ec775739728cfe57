#include <gtest/gtest.h>

#include <string>
#include <thread>
#include <vector>

#include "gimnet/nif_names.h"
#include "proto/control/ns.hpp"
#include "tests/client/nif/support/fake_hub.hpp"

// Through the whole library, with a hub that a test plays: what a program is told after a break of
// services that moved meanwhile, and of subscribers that came.

namespace gimnet::nif {
namespace {

using test::connect_to;
using test::Connected;
using test::FakeConnection;
using test::FakeHub;
using test::make_welcome;
namespace ns = proto::ns;

constexpr std::uint32_t kKnown = (7u << 20) | 5;
constexpr std::uint32_t kPresent = (7u << 20) | 7;

class ToldAgain : public ::testing::Test {
 protected:
  ToldAgain()
      : connected_(connect_to(hub_, test::default_options("robot"), make_welcome(1 << 20))) {
    const nif_pace pace{sizeof pace, 2, 0, 0.0};
    std::thread asking([&] {
      EXPECT_EQ(
          nif_subscribe_paced(connected_.node.get(), "peer/scan", &pace, nullptr, NIF_FOREVER),
          NIF_OK);
    });
    answer_subscribe(kKnown);
    asking.join();
  }
  /// `provider` 0: nobody provides it.
  void answer_subscribe(std::uint32_t group, std::uint32_t provider = test::kPeerId) {
    std::uint16_t number = 0;
    const auto request = connected_.hub.next_request<ns::Subscribe>(number);
    ASSERT_TRUE(request);
    ns::SubscribeAnswer answer{state(group, provider)};
    answer.number = request->number;
    connected_.hub.send_control(proto::Kind::ns, proto::encode_answer(answer, number));
  }
  static ns::ServiceState state(std::uint32_t group, std::uint32_t provider) {
    ns::ServiceState state;
    state.group = GroupId{group};
    state.provider = NodeId{provider};
    state.session = provider != 0 ? 3 : 0;
    state.window = group != 0 ? 2 : 0;
    return state;
  }
  void come_back() {
    connected_.hub.close();
    proto::Welcome welcome = make_welcome(1 << 20);
    welcome.resumed = true;
    connected_.hub = hub_.admit(welcome);
    EXPECT_EQ(next().type, NIF_DISCONNECTED);
    EXPECT_EQ(next().type, NIF_CONNECTED);
  }
  void tell(std::uint32_t group, std::uint32_t provider = test::kPeerId) {
    connected_.hub.send_control(
        proto::Kind::ns, proto::encode(ns::ServiceMoved{state(group, provider), "peer/scan"}));
  }
  void publish(std::uint32_t group) {
    proto::FrameParts parts;
    parts.header.kind = proto::Kind::group;
    parts.header.src = test::kPeerId;
    parts.header.dst = group;
    connected_.hub.send(parts, "x");
  }
  nif_incoming next() {
    nif_incoming in{};
    EXPECT_EQ(nif_receive(connected_.node.get(), &in, NIF_FOREVER), NIF_OK);
    nif_release(&in);
    return in;
  }
  void expect_moved(std::uint32_t group, std::uint32_t provider = test::kPeerId) {
    const nif_incoming in = next();
    EXPECT_EQ(in.type, NIF_SERVICE_MOVED);
    EXPECT_EQ(in.group, group);
    EXPECT_EQ(in.from, provider);
    EXPECT_EQ(in.count, provider != 0 ? 3u : 0u) << "the provider's session";
  }
  void expect_message(std::uint32_t group) {
    const nif_incoming in = next();
    EXPECT_EQ(in.type, NIF_MESSAGE);
    EXPECT_EQ(in.to, group);
  }
  std::uint64_t credited(std::uint32_t group) {
    while (const auto credit = connected_.hub.next_flow<proto::flow::Credit>()) {
      if (credit->group == GroupId{group}) return credit->taken;
    }
    return 0;
  }

  FakeHub hub_;
  Connected connected_;
};

TEST_F(ToldAgain, ComesBeforeWhatWaited) {
  come_back();
  tell(kPresent);
  for (const std::uint32_t group : {kKnown, kPresent}) publish(group);
  answer_subscribe(kPresent);
  expect_moved(kPresent);
  for (const std::uint32_t group : {kKnown, kPresent}) expect_message(group);
  EXPECT_EQ(credited(kPresent), 1u);
  publish(kPresent);
  expect_message(kPresent);  // the answer brought nothing new
}

TEST_F(ToldAgain, CountsGoOn) {
  tell(kPresent);
  expect_moved(kPresent);
  for (std::uint64_t i = 1; i <= 3; ++i) {
    publish(kPresent);
    expect_message(kPresent);
    EXPECT_EQ(credited(kPresent), i);
  }
  come_back();
  tell(kPresent);
  answer_subscribe(kPresent);
  expect_moved(kPresent);
  publish(kPresent);
  expect_message(kPresent);
  std::uint64_t last = credited(kPresent);
  if (last == 3) last = credited(kPresent);  // repeated after WELCOME
  EXPECT_EQ(last, 4u)
      << "what was counted since the event came first was forgotten: the window would be shut";
}

TEST_F(ToldAgain, OfAServiceThatIsGone) {
  come_back();
  tell(kKnown, 0);
  answer_subscribe(kKnown, 0);
  expect_moved(kKnown, 0);
  publish(kKnown);
  expect_message(kKnown);  // which waited
}

TEST_F(ToldAgain, HowManySubscribersThereAre) {
  const auto answer_advertise = [&](std::uint32_t subscribers) {
    std::uint16_t number = 0;
    const auto request = connected_.hub.next_request<ns::Advertise>(number);
    ASSERT_TRUE(request);
    connected_.hub.send_control(
        proto::Kind::ns,
        proto::encode_answer(ns::AdvertiseAnswer{GroupId{kPresent}, subscribers}, number));
  };
  for (const nif_direction direction : {NIF_PROVIDES, NIF_ACCEPTS}) {
    std::thread asking([&] {
      nif_service service{};
      service.struct_size = sizeof service;
      service.name = "odom";
      service.direction = static_cast<std::uint8_t>(direction);
      std::uint32_t group = 0;
      EXPECT_EQ(nif_advertise(connected_.node.get(), &service, &group, nullptr, NIF_FOREVER),
                NIF_OK);
    });
    answer_advertise(0);
    asking.join();
    come_back();
    answer_advertise(3);
    answer_subscribe(kKnown);
    if (direction == NIF_PROVIDES) {
      const nif_incoming in = next();
      EXPECT_EQ(in.type, NIF_SUBSCRIBERS);
      EXPECT_EQ(in.group, kPresent);
      EXPECT_EQ(in.from, 0u);
      EXPECT_EQ(in.count, 3u);
    }
    publish(kKnown);
    expect_message(kKnown);
  }
}

TEST_F(ToldAgain, SaysWhetherAServiceThatAcceptsIsAway) {
  ns::ServiceState away = state(kKnown, test::kPeerId);
  away.direction = ns::Direction::accepts;
  away.away = true;
  connected_.hub.send_control(proto::Kind::ns, proto::encode(ns::ServiceMoved{away, "peer/scan"}));
  const nif_incoming gone = next();
  EXPECT_EQ(gone.type, NIF_SERVICE_MOVED);
  EXPECT_EQ(gone.flags, NIF_SERVICE_AWAY);
  // It was there again while this node was away itself.
  come_back();
  answer_subscribe(kKnown);
  const nif_incoming back = next();
  EXPECT_EQ(back.type, NIF_SERVICE_MOVED);
  EXPECT_EQ(back.flags, 0);
}

}  // namespace
}  // namespace gimnet::nif
