#include "gimnet/nif_watch.h"

#include <gtest/gtest.h>

#include <atomic>
#include <string>
#include <thread>

#include "proto/control/ns_register.hpp"
#include "proto/control/ns_watch.hpp"
#include "tests/client/nif/support/fake_hub.hpp"

namespace gimnet::nif::test {
namespace {

namespace ns = proto::ns;

/// Runs `ask` in a thread of its own while `answer` plays the hub.
template <class Ask, class Answer>
void converse(Ask ask, Answer answer) {
  std::thread asking(ask);
  answer();
  asking.join();
}

TEST(NifWatch, ChecksWhatItIsGivenBeforeItAsks) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_node* const node = connected.node.get();
  std::uint32_t watch = 0;
  EXPECT_EQ(nif_watch(node, "a//b", NIF_WATCH_ALL, &watch, 0), NIF_BAD_NAME);
  EXPECT_EQ(nif_watch(node, nullptr, 0, &watch, 0), NIF_BAD_ARGUMENT);
  EXPECT_EQ(nif_watch(node, nullptr, 4, &watch, 0), NIF_BAD_ARGUMENT);
  EXPECT_EQ(nif_watch(node, nullptr, NIF_WATCH_ALL, nullptr, 0), NIF_BAD_ARGUMENT);
  EXPECT_EQ(nif_watch_again(node, 5, 0), NIF_NOT_FOUND);
  EXPECT_EQ(nif_unwatch(node, 5, 0), NIF_NOT_FOUND);
  EXPECT_EQ(nif_register(node, "a b", 0), NIF_BAD_NAME);
  EXPECT_EQ(nif_register(node, nullptr, 0), NIF_BAD_ARGUMENT);
  EXPECT_EQ(nif_watch(nullptr, nullptr, NIF_WATCH_ALL, &watch, 0), NIF_CLOSED);
}

TEST(NifWatch, TakesANameAndLosesItToANodeOfAnotherHub) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_node* const node = connected.node.get();
  std::atomic<bool> has_name{false};
  converse(
      [node, &has_name] {
        EXPECT_EQ(nif_register(node, "hall/forklift", NIF_FOREVER), NIF_OK);
        nif_info info{};
        info.struct_size = sizeof info;
        EXPECT_EQ(nif_get_info(node, &info), NIF_OK);
        EXPECT_STREQ(info.name, "hall/forklift");
        has_name = true;
        nif_incoming in{};
        ASSERT_EQ(nif_receive(node, &in, NIF_FOREVER), NIF_OK);
        EXPECT_EQ(in.type, static_cast<std::uint32_t>(NIF_NAME_LOST));
        EXPECT_STREQ(in.text, "hall/forklift");
        EXPECT_EQ(in.from, kPeerId);
        nif_release(&in);
        ASSERT_EQ(nif_receive(node, &in, NIF_FOREVER), NIF_OK);
        EXPECT_EQ(in.type, static_cast<std::uint32_t>(NIF_SESSION_REPLACED));
        EXPECT_NE(std::string_view(in.text).find("late"), std::string_view::npos) << in.text;
        nif_release(&in);
        EXPECT_EQ(nif_get_info(node, &info), NIF_OK);
        EXPECT_TRUE(info.ended != 0 && info.replaced != 0);
        EXPECT_EQ(nif_flush(node), NIF_REPLACED);
      },
      [&] {
        std::uint16_t number = 0;
        const auto request = connected.hub.next_request<ns::RegisterName>(number);
        ASSERT_TRUE(request);
        EXPECT_EQ(request->name, "hall/forklift");
        connected.hub.send_control(
            proto::Kind::ns,
            proto::encode_answer(ns::RegisterNameAnswer{"hall/forklift", {std::byte{1}}}, number));
        while (!has_name) std::this_thread::yield();
        connected.hub.send_control(
            proto::Kind::ns, proto::encode(ns::NameLost{"hall/forklift", NodeId{kPeerId}, "late"}));
      });
}

TEST(NifWatch, DeliversWhatIsToldAndAcknowledgesIt) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_node* const node = connected.node.get();
  converse(
      [node] {
        std::uint32_t watch = 0;
        ASSERT_EQ(nif_watch(node, "hall/*", NIF_WATCH_NODES, &watch, NIF_FOREVER), NIF_OK);
        for (const std::uint32_t change : {NIF_SNAPSHOT_BEGINS, NIF_PRESENT, NIF_SNAPSHOT_ENDS}) {
          nif_incoming in{};
          ASSERT_EQ(nif_receive(node, &in, NIF_FOREVER), NIF_OK);
          ASSERT_EQ(in.type, static_cast<std::uint32_t>(NIF_WATCHED));
          EXPECT_EQ(in.watched->watch, watch);
          EXPECT_EQ(in.watched->change, change);
          if (change == NIF_PRESENT) {
            EXPECT_STREQ(in.watched->node->name, "hall/robot");
          }
          nif_release(&in);
        }
      },
      [&] {
        std::uint16_t number = 0;
        const auto request = connected.hub.next_request<ns::Watch>(number);
        ASSERT_TRUE(request);
        EXPECT_EQ(request->pattern, "hall/*");
        EXPECT_EQ(request->subjects, ns::kWatchNodes);
        connected.hub.send_control(proto::Kind::ns,
                                   proto::encode_answer(ns::WatchAnswer{true}, number));
        ns::WatchEvents events;
        events.watch = request->watch;
        events.epoch = 5;
        events.changes.resize(3);
        events.changes[1].kind = ns::ChangeKind::present;
        events.changes[1].node.emplace();
        events.changes[1].node->node = NodeId{kPeerId};
        events.changes[1].node->name = "hall/robot";
        events.changes[2].kind = ns::ChangeKind::end;
        connected.hub.send_control(proto::Kind::ns, proto::encode(events));
        const auto taken = connected.hub.next_request<ns::WatchTaken>(number);
        ASSERT_TRUE(taken);
        EXPECT_EQ(taken->watch, request->watch);
        EXPECT_EQ(taken->frames, 1u);
        EXPECT_NE(number, 0) << "its answer is waited for before the hub's limit is used up";
      });
}

/// One WATCH_EVENTS with a change behind that version, or, from 0, the begin.
ns::WatchEvents change_behind(std::uint32_t watch, std::uint64_t version) {
  ns::WatchEvents events;
  events.watch = watch;
  events.epoch = 5;
  events.after = version;
  events.version = version + 1;
  events.changes.resize(1);
  events.changes[0].kind = version == 0 ? ns::ChangeKind::begin : ns::ChangeKind::left;
  return events;
}

void expect_watched(nif_node* node) {
  nif_incoming in{};
  ASSERT_EQ(nif_receive(node, &in, NIF_FOREVER), NIF_OK);
  EXPECT_EQ(in.type, static_cast<std::uint32_t>(NIF_WATCHED));
  nif_release(&in);
}

// The hub counts each WATCH_TAKEN until it has answered it, and closes whoever has more unanswered
// than 64.
TEST(NifWatch, WhatItTookCountsAmongTheRequestsThatTheHubHasNotAnswered) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_node* const node = connected.node.get();
  std::uint32_t watch = 0;
  std::uint16_t number = 0;
  converse([&] { ASSERT_EQ(nif_watch(node, nullptr, NIF_WATCH_ALL, &watch, NIF_FOREVER), NIF_OK); },
           [&] {
             ASSERT_TRUE(connected.hub.next_request<ns::Watch>(number));
             connected.hub.send_control(proto::Kind::ns,
                                        proto::encode_answer(ns::WatchAnswer{true}, number));
           });
  for (std::size_t i = 0; i < proto::kOpenRequestsMax; ++i) {
    std::uint32_t id = 0;
    ASSERT_EQ(nif_resolve(node, ("robot-" + std::to_string(i)).c_str(), &id, 0), NIF_TIMEOUT);
    ASSERT_TRUE(connected.hub.next_request<ns::Resolve>(number));
  }
  for (std::uint64_t version = 0; version < 3; ++version) {
    connected.hub.send_control(proto::Kind::ns, proto::encode(change_behind(watch, version)));
    expect_watched(node);
  }
  connected.hub.send_control(proto::Kind::ns,
                             proto::encode_answer(ns::ResolveAnswer{NodeId{kPeerId}}, number));
  const auto taken = connected.hub.next_request<ns::WatchTaken>(number);
  ASSERT_TRUE(taken);
  EXPECT_EQ(taken->watch, watch);
  EXPECT_EQ(taken->frames, 3u) << "none of them was told while 64 requests waited";
  connected.hub.send_control(proto::Kind::ns, proto::encode(change_behind(watch, 3)));
  expect_watched(node);
  connected.hub.send_control(proto::Kind::ns, proto::encode_answer(ns::WatchTakenAnswer{}, number));
  const auto next = connected.hub.next_request<ns::WatchTaken>(number);
  ASSERT_TRUE(next);
  EXPECT_EQ(next->frames, 1u);
}

}  // namespace
}  // namespace gimnet::nif::test
