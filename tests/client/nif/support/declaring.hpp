#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "gimnet/nif_names.h"
#include "proto/control/ns.hpp"
#include "tests/client/nif/support/fake_hub.hpp"

// Own services, and a hub that is told of them again after a break.

namespace gimnet::nif::test {

inline constexpr std::uint32_t kGroup = 11;
inline constexpr std::uint32_t kResumeBytes = 1u << 20;

inline nif_status publish(nif_node* node, std::uint32_t group, std::string_view payload,
                          std::int32_t timeout_ms = NIF_FOREVER) {
  const nif_bytes part = {payload.data(), payload.size()};
  nif_outgoing message = NIF_OUTGOING_INIT;
  message.kind = NIF_GROUP;
  message.to = group;
  message.parts = &part;
  message.part_count = 1;
  return nif_send(node, &message, timeout_ms);
}

/// The next request is ADVERTISE of `name`, and is answered with that group; 0: refused.
inline void answer_advertise(FakeConnection& hub, const std::string& name, std::uint32_t group) {
  std::uint16_t number = 0;
  const auto request = hub.next_request<proto::ns::Advertise>(number);
  ASSERT_TRUE(request);
  EXPECT_EQ(request->service, name);
  const proto::ControlHeader header{proto::ns::Advertise::kOperation, number};
  hub.send_control(proto::Kind::ns,
                   group != 0
                       ? proto::encode_answer(proto::ns::AdvertiseAnswer{GroupId{group}, 0}, number)
                       : proto::encode_refusal(header, {proto::Status::limit, "no more"}));
}

inline void advertise(Connected& connected, const char* name, std::uint32_t group, bool retain,
                      std::uint32_t type = 0) {
  std::thread asking([&] {
    nif_service service{};
    service.struct_size = sizeof service;
    service.name = name;
    service.message_type = type;
    service.retain = retain ? 1 : 0;
    std::uint32_t given = 0;
    EXPECT_EQ(nif_advertise(connected.node.get(), &service, &given, nullptr, NIF_FOREVER), NIF_OK);
    EXPECT_EQ(given, group);
  });
  answer_advertise(connected.hub, name, group);
  asking.join();
}

/// The next message is for that group.
inline void expect_published(FakeConnection& hub, std::uint32_t group, const std::string& payload) {
  std::string received;
  do {
    const auto frame = hub.next_message();
    ASSERT_TRUE(frame);
    ASSERT_EQ(frame->header.kind, proto::Kind::group);
    EXPECT_EQ(frame->header.dst, group);
    EXPECT_EQ(frame->header.src, kOwnId);
    received += frame->payload();
  } while (received.size() < payload.size());
  EXPECT_TRUE(received == payload) << payload.substr(0, 20);
}

/// A node with a retained service `map` whose last message is `last`, which was confirmed.
inline Connected with_map(FakeHub& hub, const std::string& last, bool retain = true) {
  Connected connected = connect_to(hub, default_options("robot"), make_welcome(kResumeBytes));
  advertise(connected, "map", kGroup, retain);
  std::thread publishing([&] {
    EXPECT_EQ(publish(connected.node.get(), kGroup, "older"), NIF_OK);
    EXPECT_EQ(publish(connected.node.get(), kGroup, last), NIF_OK);
  });
  expect_published(connected.hub, kGroup, "older");
  expect_published(connected.hub, kGroup, last);
  publishing.join();
  return connected;
}

inline void come_back(FakeHub& hub, Connected& connected, bool resumed, std::uint64_t taken = 0) {
  const std::uint32_t before = info_of(connected.node.get()).reconnects;
  connected.hub.close();
  proto::Welcome welcome = make_welcome(kResumeBytes);
  welcome.resumed = resumed;
  welcome.taken = taken;
  connected.hub = hub.admit(welcome);
  while (info_of(connected.node.get()).reconnects == before) std::this_thread::yield();
}

/// The next request is WITHDRAW of that group; `known`: and the hub has such a service.
inline void answer_withdraw(FakeConnection& hub, std::uint32_t group, bool known) {
  std::uint16_t number = 0;
  const auto request = hub.next_request<proto::ns::Withdraw>(number);
  ASSERT_TRUE(request);
  EXPECT_EQ(request->group, GroupId{group});
  const proto::ControlHeader header{proto::ns::Withdraw::kOperation, number};
  hub.send_control(
      proto::Kind::ns,
      known ? proto::encode_answer(proto::ns::WithdrawAnswer{}, number)
            : proto::encode_refusal(header, {proto::Status::not_found, "no such service"}));
}

/// The next request is SUBSCRIBE, of a service that nobody provides.
inline void answer_subscribe(FakeConnection& hub) {
  std::uint16_t number = 0;
  ASSERT_TRUE(hub.next_request<proto::ns::Subscribe>(number));
  hub.send_control(proto::Kind::ns, proto::encode_answer(proto::ns::SubscribeAnswer{}, number));
}

/// The next request is UNSUBSCRIBE; `known`: and the hub has such a subscription.
inline void answer_unsubscribe(FakeConnection& hub, bool known) {
  std::uint16_t number = 0;
  ASSERT_TRUE(hub.next_request<proto::ns::Unsubscribe>(number));
  const proto::ControlHeader header{proto::ns::Unsubscribe::kOperation, number};
  hub.send_control(
      proto::Kind::ns,
      known ? proto::encode_answer(proto::ns::UnsubscribeAnswer{}, number)
            : proto::encode_refusal(header, {proto::Status::not_found, "no such subscription"}));
}

/// Skips what was received before the next NIF_OWN_SERVICE_MOVED; returns the group.
inline std::uint32_t wait_for_move(nif_node* node) {
  for (nif_incoming in; nif_receive(node, &in, NIF_FOREVER) == NIF_OK; nif_release(&in)) {
    if (in.type != NIF_OWN_SERVICE_MOVED) continue;
    nif_release(&in);
    return in.group;
  }
  ADD_FAILURE();
  return 0;
}

/// The next frame is not about services.
inline void expect_nothing_declared(Connected& connected) {
  EXPECT_EQ(nif_send_to(connected.node.get(), kPeerId, "x", 1), NIF_OK);
  const auto frame = connected.hub.next_message();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->header.kind, proto::Kind::unicast);
}

}  // namespace gimnet::nif::test
