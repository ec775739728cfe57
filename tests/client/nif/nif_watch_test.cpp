#include "gimnet/nif_watch.h"

#include <gtest/gtest.h>

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
  EXPECT_EQ(nif_register(node, "a b", nullptr, 0), NIF_BAD_NAME);
  EXPECT_EQ(nif_register(node, nullptr, nullptr, 0), NIF_BAD_ARGUMENT);
  EXPECT_EQ(nif_watch(nullptr, nullptr, NIF_WATCH_ALL, &watch, 0), NIF_CLOSED);
}

TEST(NifWatch, TakesANameAndSaysWhetherItIsProvisional) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_node* const node = connected.node.get();
  converse(
      [node] {
        std::uint8_t provisional = 0;
        EXPECT_EQ(nif_register(node, "forklift", &provisional, NIF_FOREVER), NIF_OK);
        EXPECT_EQ(provisional, 1);
        nif_info info{};
        info.struct_size = sizeof info;
        EXPECT_EQ(nif_get_info(node, &info), NIF_OK);
        EXPECT_STREQ(info.name, "forklift");
        nif_incoming in{};
        ASSERT_EQ(nif_receive(node, &in, NIF_FOREVER), NIF_OK);
        EXPECT_EQ(in.type, static_cast<std::uint32_t>(NIF_NAME_LOST));
        EXPECT_STREQ(in.text, "forklift");
        EXPECT_EQ(in.from, kPeerId);
        nif_release(&in);
        EXPECT_EQ(nif_get_info(node, &info), NIF_OK);
        EXPECT_STREQ(info.name, "") << "it goes on without";
      },
      [&] {
        std::uint16_t number = 0;
        const auto request = connected.hub.next_request<ns::RegisterName>(number);
        ASSERT_TRUE(request);
        EXPECT_EQ(request->name, "forklift");
        connected.hub.send_control(
            proto::Kind::ns, proto::encode_answer(ns::RegisterNameAnswer{"forklift", true, {std::byte{1}}}, number));
        connected.hub.send_control(proto::Kind::ns, proto::encode(ns::NameLost{"forklift", NodeId{kPeerId}, "late"}));
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
        connected.hub.send_control(proto::Kind::ns, proto::encode_answer(ns::WatchAnswer{true}, number));
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
        EXPECT_EQ(number, 0) << "nobody waits for an answer";
      });
}

}  // namespace
}  // namespace gimnet::nif::test
