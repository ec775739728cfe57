#include <gtest/gtest.h>

#include <string>
#include <thread>

#include "tests/client/nif/support/declaring.hpp"

// Tests messages that a program publishes over a break after which its service has another group,
// or none.

namespace gimnet::nif::test {
namespace {

constexpr std::uint32_t kNewGroup = 99;
constexpr std::uint32_t kPayload = 8'000;

/// "    7" and what fills it up.
std::string numbered(std::size_t number) {
  std::string payload = std::to_string(number);
  payload.insert(0, 6 - payload.size(), ' ');
  return payload + std::string(kPayload - payload.size(), 'x');
}

/// A node with a service whose messages stand in its own queue, because the hub reads nothing, at a
/// hub that then goes.
struct Interrupted {
  Interrupted() : connected(connect_to(hub, default_options("robot"), make_welcome(kResumeBytes))) {
    advertise(connected, "odom", kGroup, false);
    while (publish(connected.node.get(), kGroup, numbered(sent), 1) == NIF_OK) ++sent;
    connected.hub.close();
    while (info_of(connected.node.get()).connected != 0) std::this_thread::yield();
    queued = counters_of(connected.node.get()).send_queue_bytes / (kPayload + 28);
    EXPECT_GT(queued, 0u);
  }

  FakeHub hub;
  Connected connected;
  std::size_t sent = 0;
  std::size_t queued = 0;
};

TEST(MovedGroups, WhatWasQueuedGoesToTheNewGroup) {
  Interrupted broken;
  come_back(broken.hub, broken.connected, false);
  answer_advertise(broken.connected.hub, "odom", kNewGroup);
  for (std::size_t i = broken.sent - broken.queued; i < broken.sent; ++i) {
    expect_published(broken.connected.hub, kNewGroup, numbered(i));
  }
  while (counters_of(broken.connected.node.get()).send_queue_bytes != 0) std::this_thread::yield();
}

TEST(MovedGroups, WhatWasQueuedForARefusedServiceIsToldAsLost) {
  Interrupted broken;
  nif_node* const node = broken.connected.node.get();
  come_back(broken.hub, broken.connected, false);
  answer_advertise(broken.connected.hub, "odom", 0);
  nif_incoming in;
  for (const auto type : {NIF_DISCONNECTED, NIF_CONNECTED, NIF_OWN_SERVICE_MOVED, NIF_GAP}) {
    ASSERT_EQ(nif_receive(node, &in, NIF_FOREVER), NIF_OK);
    EXPECT_EQ(in.type, static_cast<std::uint32_t>(type));
    if (type != NIF_GAP) nif_release(&in);
  }
  EXPECT_EQ(in.from, kOwnId);
  EXPECT_EQ(in.count, broken.queued);
  EXPECT_STREQ(in.text, "no_such_group");
  nif_release(&in);
  EXPECT_EQ(nif_drain(node, NIF_FOREVER), NIF_NOT_CONNECTED) << "once";
  EXPECT_EQ(publish(node, kGroup, "x"), NIF_REFUSED);
}

TEST(MovedGroups, WhatIsSentMeanwhileGoesToTheNewGroup) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options("robot"), make_welcome(kResumeBytes));
  advertise(connected, "odom", kGroup, false);
  for (const std::string& payload : {std::string("small"), std::string(100'000, 'l')}) {
    connected.hub.close();
    while (info_of(connected.node.get()).connected != 0) std::this_thread::yield();
    std::thread publishing(
        [&] { EXPECT_EQ(publish(connected.node.get(), kGroup, payload), NIF_OK); });
    come_back(hub, connected, false);
    answer_advertise(connected.hub, "odom", kNewGroup);
    expect_published(connected.hub, kNewGroup, payload);
    publishing.join();
  }
  EXPECT_EQ(publish(connected.node.get(), kGroup, "by a program that does not know yet"), NIF_OK);
  expect_published(connected.hub, kNewGroup, "by a program that does not know yet");
}

TEST(MovedGroups, WhatIsSentToARefusedServiceIsRefused) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options("robot"), make_welcome(kResumeBytes));
  advertise(connected, "odom", kGroup, false);
  connected.hub.close();
  while (info_of(connected.node.get()).connected != 0) std::this_thread::yield();
  std::thread publishing(
      [&] { EXPECT_EQ(publish(connected.node.get(), kGroup, "x"), NIF_REFUSED); });
  come_back(hub, connected, false);
  answer_advertise(connected.hub, "odom", 0);
  publishing.join();
  come_back(hub, connected, false);
  answer_advertise(connected.hub, "odom", kNewGroup);
  EXPECT_EQ(publish(connected.node.get(), kGroup, "back"), NIF_OK);
  expect_published(connected.hub, kNewGroup, "back");
}

TEST(MovedGroups, ARefusedServiceIsToldWithItsReasonAndThatItIsThereAgain) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options("robot"), make_welcome(kResumeBytes));
  advertise(connected, "odom", kGroup, false);
  come_back(hub, connected, false);
  answer_advertise(connected.hub, "odom", 0);
  nif_incoming in{};
  while (nif_receive(connected.node.get(), &in, NIF_FOREVER) == NIF_OK &&
         in.type != NIF_OWN_SERVICE_MOVED) {
    nif_release(&in);
  }
  EXPECT_EQ(in.group, 0u);
  EXPECT_EQ(in.reason, static_cast<std::uint32_t>(NIF_LIMIT));
  EXPECT_EQ(std::string(static_cast<const char*>(in.payload), in.size), "no more");
  nif_release(&in);
  come_back(hub, connected, false);
  answer_advertise(connected.hub, "odom", kNewGroup);
  EXPECT_EQ(wait_for_move(connected.node.get()), kNewGroup);
}

TEST(MovedGroups, ARefusedSubscriptionIsToldOnceWithItsReasonAndThatItStandsAgain) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options("robot"), make_welcome(kResumeBytes));
  std::thread asking([&] {
    EXPECT_EQ(nif_subscribe(connected.node.get(), "peer/scan", nullptr, NIF_FOREVER), NIF_OK);
  });
  answer_subscribe(connected.hub);
  asking.join();
  for (int i = 0; i < 2; ++i) {
    come_back(hub, connected, false);
    std::uint16_t number = 0;
    ASSERT_TRUE(connected.hub.next_request<proto::ns::Subscribe>(number));
    connected.hub.send_control(proto::Kind::ns,
                               proto::encode_refusal({proto::ns::Subscribe::kOperation, number},
                                                     {proto::Status::limit, "no more"}));
  }
  come_back(hub, connected, false);
  answer_subscribe(connected.hub);
  advertise(connected, "odom", kGroup, false);
  connected.hub.close();
  int told = 0;
  for (int breaks = 0; breaks < 4;) {
    nif_incoming in{};
    ASSERT_EQ(nif_receive(connected.node.get(), &in, NIF_FOREVER), NIF_OK);
    breaks += in.type == NIF_DISCONNECTED ? 1 : 0;
    if (in.type == NIF_SERVICE_MOVED) {
      ++told;
      EXPECT_STREQ(in.text, "peer/scan");
      EXPECT_EQ(in.group, 0u);
      const bool refused = told == 1;  // then the hub took it again, and there is no provider
      EXPECT_EQ(in.reason, static_cast<std::uint32_t>(refused ? NIF_LIMIT : NIF_OK));
      EXPECT_EQ(std::string(static_cast<const char*>(in.payload), in.size),
                refused ? "no more" : "");
    }
    nif_release(&in);
  }
  EXPECT_EQ(told, 2);
}

}  // namespace
}  // namespace gimnet::nif::test
