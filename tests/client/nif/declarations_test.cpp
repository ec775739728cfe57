#include "client/nif/declarations.hpp"

#include <gtest/gtest.h>

#include <map>
#include <optional>
#include <string>
#include <thread>

#include "client/nif/handles.hpp"
#include "client/nif/node.hpp"
#include "gimnet/nif_names.h"
#include "tests/client/nif/support/declaring.hpp"

// Services and subscriptions that end, or begin anew, while the library declares again. The
// rest of it is in declarations_retained_test.cpp, node_test.cpp and nif_names_test.cpp.

namespace gimnet::nif::test {
namespace {

TEST(Declarations, WithdrawAServiceThatMovesMeanwhile) {
  FakeHub hub;
  Connected connected = with_map(hub, "map");
  come_back(hub, connected, false);
  std::uint16_t number = 0;
  ASSERT_TRUE(connected.hub.next_request<proto::ns::Advertise>(number));
  std::thread withdrawing(
      [&] { EXPECT_EQ(nif_withdraw_service(connected.node.get(), "map", NIF_FOREVER), NIF_OK); });
  std::uint16_t withdrawn = 0;
  const auto request = connected.hub.next_request<proto::ns::Withdraw>(withdrawn);
  ASSERT_TRUE(request);
  EXPECT_EQ(request->group, GroupId{kGroup}) << "the hub has it as another one by now";
  connected.hub.send_control(
      proto::Kind::ns, proto::encode_answer(proto::ns::AdvertiseAnswer{GroupId{99}, 0}, number));
  answer_withdraw(connected.hub, 99, true);
  connected.hub.send_control(proto::Kind::ns,
                             proto::encode_refusal({proto::ns::Withdraw::kOperation, withdrawn},
                                                   {proto::Status::not_found, "no such service"}));
  withdrawing.join();
  expect_nothing_declared(connected);
  come_back(hub, connected, false);
  expect_nothing_declared(connected);
}

TEST(Declarations, WithdrawAServiceThatEndedDuringABreak) {
  FakeHub hub;
  Connected connected = with_map(hub, "map");
  connected.hub.close();
  while (info_of(connected.node.get()).connected != 0) std::this_thread::yield();
  EXPECT_EQ(nif_withdraw_service(connected.node.get(), "map", 0), NIF_NOT_CONNECTED);
  EXPECT_EQ(nif_withdraw_service(connected.node.get(), "map", 0), NIF_NOT_FOUND) << "it ended";
  come_back(hub, connected, true, 2);
  answer_withdraw(connected.hub, kGroup, true);
  come_back(hub, connected, true, 2);
  expect_nothing_declared(connected);
}

TEST(Declarations, WithdrawWhatBecameOfAServiceThatEndedUnanswered) {
  FakeHub hub;
  Connected connected = with_map(hub, "map");
  come_back(hub, connected, false);
  std::uint16_t number = 0;
  ASSERT_TRUE(connected.hub.next_request<proto::ns::Advertise>(number));
  connected.hub.close();
  while (info_of(connected.node.get()).connected != 0) std::this_thread::yield();
  EXPECT_EQ(nif_withdraw_service(connected.node.get(), "map", 0), NIF_NOT_CONNECTED);
  come_back(hub, connected, false);
  answer_advertise(connected.hub, "map", 99);
  answer_withdraw(connected.hub, 99, true);
  expect_nothing_declared(connected);
}

TEST(Declarations, ForgetAServiceThatEndedWhileAHubRefusedIt) {
  FakeHub hub;
  Connected connected = with_map(hub, "map");
  come_back(hub, connected, false);
  answer_advertise(connected.hub, "map", 0);
  EXPECT_EQ(wait_for_move(connected.node.get()), 0u);
  EXPECT_EQ(nif_withdraw_service(connected.node.get(), "map", NIF_FOREVER), NIF_OK)
      << "the hub has nothing to say";
  come_back(hub, connected, false);
  expect_nothing_declared(connected);
}

/// The hub has not heard of its end when the program advertises the service anew.
TEST(Declarations, DoNotWithdrawAServiceThatIsAdvertisedAnew) {
  FakeHub hub;
  Connected connected = with_map(hub, "map");
  nif_node* const node = connected.node.get();
  connected.hub.close();
  while (info_of(node).connected != 0) std::this_thread::yield();
  EXPECT_EQ(nif_withdraw_service(node, "map", 0), NIF_NOT_CONNECTED);
  nif_service service{};
  service.struct_size = sizeof service;
  service.name = "map";
  service.message_type = 8;
  std::uint32_t group = 0;
  EXPECT_EQ(nif_advertise(node, &service, &group, nullptr, 0), NIF_NOT_CONNECTED)
      << "it ended all the same";
  come_back(hub, connected, false);
  answer_withdraw(connected.hub, kGroup, false);
  expect_nothing_declared(connected);
}

TEST(Declarations, WithdrawNothingBehindAServiceThatIsAdvertisedAnew) {
  FakeHub hub;
  Connected connected = with_map(hub, "map");
  nif_node* const node = connected.node.get();
  connected.hub.close();
  while (info_of(node).connected != 0) std::this_thread::yield();
  EXPECT_EQ(nif_withdraw_service(node, "map", 0), NIF_NOT_CONNECTED);
  std::thread asking([node] {
    nif_service service{};
    service.struct_size = sizeof service;
    service.name = "map";
    service.message_type = 8;
    std::uint32_t group = 0;
    EXPECT_EQ(nif_advertise(node, &service, &group, nullptr, NIF_FOREVER), NIF_OK);
    EXPECT_EQ(nif_send_to(node, kPeerId, "x", 1), NIF_OK);
  });
  connected.hub = hub.admit(make_welcome(kResumeBytes));
  bool anew = false;
  while (const auto frame = connected.hub.next_message()) {
    if (frame->header.kind != proto::Kind::ns) break;
    const auto payload = frame->view().payload;
    const std::uint16_t number = proto::split_control(payload)->header.request;
    if (const auto request = proto::decode<proto::ns::Advertise>(payload)) {
      anew |= request->message_type == 8;
      connected.hub.send_control(
          proto::Kind::ns,
          proto::encode_answer(proto::ns::AdvertiseAnswer{GroupId{kGroup}, 0}, number));
    } else {
      EXPECT_FALSE(anew) << "the program's new service is gone";
      connected.hub.send_control(proto::Kind::ns,
                                 proto::encode_answer(proto::ns::WithdrawAnswer{}, number));
    }
  }
  asking.join();
  EXPECT_TRUE(anew);
}

/// A node that subscribed peer/scan, and is not connected.
Connected with_broken_subscription(FakeHub& hub) {
  Connected connected = connect_to(hub, default_options("robot"), make_welcome(kResumeBytes));
  nif_node* const node = connected.node.get();
  std::thread asking(
      [node] { EXPECT_EQ(nif_subscribe(node, "peer/scan", nullptr, NIF_FOREVER), NIF_OK); });
  answer_subscribe(connected.hub);
  asking.join();
  connected.hub.close();
  while (info_of(node).connected != 0) std::this_thread::yield();
  return connected;
}

/// Returns when the node has taken everything that the hub sent before.
void settle(Connected& connected) {
  connected.hub.send_unicast(kPeerId, kOwnId, "settled");
  nif_incoming in{};
  do {
    ASSERT_EQ(nif_receive(connected.node.get(), &in, NIF_FOREVER), NIF_OK);
    nif_release(&in);
  } while (in.type != NIF_MESSAGE);
}

TEST(Declarations, UnsubscribeWithTheNextConnectionWhatEndedDuringABreak) {
  for (const bool known : {true, false}) {
    FakeHub hub;
    Connected connected = with_broken_subscription(hub);
    EXPECT_EQ(nif_unsubscribe(connected.node.get(), "peer/scan", 0), NIF_NOT_CONNECTED);
    connected.hub = hub.admit(make_welcome(kResumeBytes));
    answer_unsubscribe(connected.hub, known);
    expect_nothing_declared(connected);
    settle(connected);
    come_back(hub, connected, false);
    expect_nothing_declared(connected);
  }
}

TEST(Declarations, UnsubscribeWhatTheyJustSubscribeAgain) {
  FakeHub hub;
  Connected connected = with_broken_subscription(hub);
  connected.hub = hub.admit(make_welcome(kResumeBytes));
  std::uint16_t subscribed = 0;
  ASSERT_TRUE(connected.hub.next_request<proto::ns::Subscribe>(subscribed));
  EXPECT_EQ(nif_unsubscribe(connected.node.get(), "peer/scan", 0), NIF_TIMEOUT);
  proto::ns::SubscribeAnswer answer;
  answer.group = GroupId{99};
  connected.hub.send_control(proto::Kind::ns, proto::encode_answer(answer, subscribed));
  std::size_t asked = 0;
  EXPECT_EQ(nif_send_to(connected.node.get(), kPeerId, "x", 1), NIF_OK);
  for (bool answered = false; !answered;) {
    const auto frame = connected.hub.next_message();
    ASSERT_TRUE(frame);
    if (frame->header.kind != proto::Kind::ns) continue;
    const auto payload = frame->view().payload;
    ASSERT_TRUE(proto::decode<proto::ns::Unsubscribe>(payload));
    const std::uint16_t number = proto::split_control(payload)->header.request;
    connected.hub.send_control(proto::Kind::ns,
                               proto::encode_answer(proto::ns::UnsubscribeAnswer{}, number));
    answered = ++asked ==
               2;  // the program's, and the library's, which cannot know that the other one left
  }
  settle(connected);
  come_back(hub, connected, false);
  expect_nothing_declared(connected);
}

TEST(Declarations, SubscribeAgainByThePaceThatTheProgramWantedLast) {
  for (const bool refused : {false, true}) {
    FakeHub hub;
    Connected connected = with_broken_subscription(hub);
    nif_node* const node = connected.node.get();
    const nif_pace pace{sizeof pace, 2, 0, 0.0};
    if (!refused) {
      EXPECT_EQ(nif_subscribe_paced(node, "peer/scan", &pace, nullptr, 0), NIF_NOT_CONNECTED);
    }
    for (int i = 0; i < 2; ++i) {
      connected.hub = hub.admit(make_welcome(kResumeBytes));
      std::uint16_t number = 0;
      const auto request = connected.hub.next_request<proto::ns::Subscribe>(number);
      ASSERT_TRUE(request);
      EXPECT_EQ(request->window, refused ? 0u : 2u);
      connected.hub.send_control(proto::Kind::ns,
                                 proto::encode_answer(proto::ns::SubscribeAnswer{}, number));
      settle(connected);
      std::thread asking([&] {
        const nif_status status =
            nif_subscribe_paced(node, "peer/scan", &pace, nullptr, NIF_FOREVER);
        EXPECT_EQ(status, refused ? NIF_LIMIT : NIF_OK);
      });
      const auto asked = connected.hub.next_request<proto::ns::Subscribe>(number);
      EXPECT_TRUE(asked && asked->window == 2);
      const proto::ControlHeader header{proto::ns::Subscribe::kOperation, number};
      connected.hub.send_control(
          proto::Kind::ns, refused ? proto::encode_refusal(header, {proto::Status::limit, "no"})
                                   : proto::encode_answer(proto::ns::SubscribeAnswer{}, number));
      asking.join();
      connected.hub.close();
    }
  }
}

TEST(Declarations, UnsubscribeNothingBehindASubscriptionThatBeginsAnew) {
  FakeHub hub;
  Connected connected = with_broken_subscription(hub);
  nif_node* const node = connected.node.get();
  EXPECT_EQ(nif_unsubscribe(node, "peer/scan", 0), NIF_NOT_CONNECTED);
  std::thread asking([node] {
    const nif_pace pace{sizeof pace, 2, 0, 0.0};
    EXPECT_EQ(nif_subscribe_paced(node, "peer/scan", &pace, nullptr, NIF_FOREVER), NIF_OK);
    EXPECT_EQ(nif_send_to(node, kPeerId, "x", 1), NIF_OK);
  });
  connected.hub = hub.admit(make_welcome(kResumeBytes));
  bool anew = false;
  while (const auto frame = connected.hub.next_message()) {
    if (frame->header.kind != proto::Kind::ns) break;
    const auto payload = frame->view().payload;
    const std::uint16_t number = proto::split_control(payload)->header.request;
    if (const auto request = proto::decode<proto::ns::Subscribe>(payload)) {
      anew |= request->window == 2;
      connected.hub.send_control(proto::Kind::ns,
                                 proto::encode_answer(proto::ns::SubscribeAnswer{}, number));
    } else {
      EXPECT_FALSE(anew) << "the program's new subscription is gone";
      connected.hub.send_control(proto::Kind::ns,
                                 proto::encode_answer(proto::ns::UnsubscribeAnswer{}, number));
    }
  }
  asking.join();
  EXPECT_TRUE(anew);
}

/// The library's thread takes the event before the asking thread enters what the hub answered.
TEST(Declarations, TellWhereAServiceThatAcceptsIsThoughAnEventOvertookItsAnswer) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options("robot"), make_welcome(kResumeBytes));
  nif_node* const node = connected.node.get();
  Node* const shared = share_node(node);
  Declarations& declarations = shared->declarations();
  proto::ns::SubscribeAnswer answer;
  answer.group = GroupId{kGroup};
  answer.provider = NodeId{kPeerId};
  answer.direction = proto::ns::Direction::accepts;
  proto::ns::ServiceMoved away{answer, "peer/drive"};
  away.away = true;
  // Nothing: a message came, and no event before it.
  const auto next_move = [node]() -> std::optional<std::uint8_t> {
    for (nif_incoming in; nif_receive(node, &in, NIF_FOREVER) == NIF_OK;) {
      const nif_incoming taken = in;
      nif_release(&in);
      if (taken.type == NIF_SERVICE_MOVED) return taken.flags;
      if (taken.type == NIF_MESSAGE) break;
    }
    return std::nullopt;
  };
  proto::ns::Subscribe request{"peer/drive"};
  EXPECT_FALSE(declarations.begin_subscription(request));
  connected.hub.send_control(proto::Kind::ns, proto::encode(away));
  EXPECT_EQ(next_move(), std::uint8_t{NIF_SERVICE_AWAY});
  declarations.add_subscription(request, answer);
  come_back(hub, connected, true);
  std::uint16_t number = 0;
  ASSERT_TRUE(connected.hub.next_request<proto::ns::Subscribe>(number));
  connected.hub.send_control(proto::Kind::ns, proto::encode_answer(answer, number));
  connected.hub.send_unicast(kPeerId, kOwnId, "settled");
  EXPECT_EQ(next_move(), std::uint8_t{0}) << "it is there";
  shared->drop();
}

/// From kPeerId, in a frame of so many bytes.
void send_group(FakeConnection& hub, std::uint32_t group, std::size_t frame_bytes) {
  proto::FrameParts parts;
  parts.header.kind = proto::Kind::group;
  parts.header.src = kPeerId;
  parts.header.dst = group;
  hub.send(parts, std::string(frame_bytes - proto::kHeaderSize, 'x'));
}

TEST(Declarations, LetMessagesOfOtherGroupsWaitUpToALimitWhileTheySubscribe) {
  constexpr std::uint32_t kOther = kGroup + 1;
  constexpr std::size_t kFrame = Declarations::kUnknownBytesMax / 8;
  FakeHub hub;
  Connected connected = connect_to(hub, default_options("robot"), make_welcome());
  nif_node* const node = connected.node.get();
  std::thread subscribing(
      [node] { EXPECT_EQ(nif_subscribe(node, "peer/scan", nullptr, NIF_FOREVER), NIF_OK); });
  std::uint16_t number = 0;
  ASSERT_TRUE(connected.hub.next_request<proto::ns::Subscribe>(number));
  for (int i = 0; i < 8; ++i) send_group(connected.hub, kOther, kFrame);
  send_group(connected.hub, kOther, proto::kHeaderSize);  // one beyond
  proto::ns::SubscribeAnswer answer;
  answer.group = GroupId{kGroup};
  connected.hub.send_control(proto::Kind::ns, proto::encode_answer(answer, number));
  for (int i = 0; i < 9; ++i) send_group(connected.hub, kGroup, kFrame);
  subscribing.join();
  send_group(connected.hub, kOther, kFrame);
  std::map<std::uint32_t, int> messages;
  std::uint64_t lost = 0;
  for (int i = 0; i < 8 + 9 + 1 + 1; ++i) {
    nif_incoming in;
    ASSERT_EQ(nif_receive(node, &in, NIF_FOREVER), NIF_OK);
    if (in.type == NIF_MESSAGE) ++messages[in.to];
    if (in.type == NIF_GAP) {
      EXPECT_STREQ(in.text, "no_subscriber");
      lost += in.count;
    }
    nif_release(&in);
  }
  EXPECT_EQ(messages, (std::map<std::uint32_t, int>{{kGroup, 9}, {kOther, 8 + 1}}));
  EXPECT_EQ(lost, 1u);
  EXPECT_EQ(counters_of(node).messages_lost, 1u);
}

}  // namespace
}  // namespace gimnet::nif::test
