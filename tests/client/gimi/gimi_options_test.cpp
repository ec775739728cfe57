#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <functional>
#include <span>
#include <string>
#include <typeinfo>
#include <vector>

#include "gimnet/gimi.h"
#include "gimnet/gimi.hpp"
#include "tests/client/gimi/support/hub_process.hpp"

// Options of gimnet/gimi.h whose values are outside their ranges.

namespace gimnet {
namespace {

class GimiOptions : public testing::Test {
 protected:
  void SetUp() override {
    gimi_node_options options{};
    options.struct_size = sizeof options;
    options.hub = hub_.url().c_str();
    options.name = "robot";
    ASSERT_EQ(gimi_join(&options, &node_), GIMI_OK);
  }
  void TearDown() override { EXPECT_EQ(gimi_close(node_), GIMI_OK); }

  template <class Options>
  static Options made() {
    Options options{};
    options.struct_size = sizeof options;
    return options;
  }
  /// Every byte of `reserved` is looked at, in options of this version's size and of a later one's.
  template <class Options, class Call>
  static void refuses_reserved(const Call& call) {
    struct Longer {
      Options now;
      std::size_t later = 0;
    };
    for (std::size_t i = 0; i < sizeof(Options::reserved); ++i) {
      for (const std::size_t size : {sizeof(Options), sizeof(Longer)}) {
        Longer longer{};
        longer.now.struct_size = size;
        std::as_writable_bytes(std::span(&longer.now.reserved, 1))[i] = std::byte{1};
        EXPECT_EQ(call(&longer.now), GIMI_BAD_ARGUMENT) << typeid(Options).name() << " byte " << i;
        EXPECT_NE(std::strstr(gimi_error_text(), "does not have"), nullptr) << gimi_error_text();
      }
    }
  }

  test::HubProcess hub_;
  gimi_handle node_ = 0;
};

TEST_F(GimiOptions, RoomForLaterVersionsMustBeZero) {
  gimi_handle made = 0;
  gimi_reply reply{};
  refuses_reserved<gimi_node_options>([&](auto* how) {
    how->hub = hub_.url().c_str();
    return gimi_join(how, &made);
  });
  refuses_reserved<gimi_publish_options>(
      [&](auto* how) { return gimi_advertise(node_, "a", how, &made); });
  refuses_reserved<gimi_subscribe_options>(
      [&](auto* how) { return gimi_subscribe(node_, "a/b", how, &made); });
  refuses_reserved<gimi_accept_options>(
      [&](auto* how) { return gimi_accept(node_, "a", how, &made); });
  refuses_reserved<gimi_send_options>([&](auto* how) { return gimi_sender(node_, 1, how, &made); });
  refuses_reserved<gimi_queue_options>(
      [&](auto* how) { return gimi_queue(node_, {1, 1}, how, &made); });
  refuses_reserved<gimi_request_options>(
      [&](auto* how) { return gimi_ask(node_, "a/b", nullptr, how, &reply); });
  refuses_reserved<gimi_answer_options>(
      [&](auto* how) { return gimi_answer(node_, "a", how, &made); });
  refuses_reserved<gimi_link_options>([&](auto* how) {
    how->url = "unix:/nowhere";
    return gimi_add_link(node_, how, 1000);
  });
  EXPECT_EQ(made, 0u);
}

TEST_F(GimiOptions, ALeaseIsRefusedInEachOfItsMembers) {
  gimi_handle queue = 0;
  auto options = made<gimi_accept_options>();
  options.safe_message = {nullptr, 1};
  EXPECT_EQ(gimi_accept(node_, "a", &options, &queue), GIMI_BAD_ARGUMENT);
  options.safe_message = {"x", 0};
  EXPECT_EQ(gimi_accept(node_, "a", &options, &queue), GIMI_BAD_ARGUMENT);
  options.safe_message = {};
  options.lease_ms = 1;
  EXPECT_EQ(gimi_accept(node_, "a", &options, &queue), GIMI_BAD_ARGUMENT);
}

TEST_F(GimiOptions, AnIdIsFoundByALiveNodeOnly) {
  gimi_peer peer = 0;
  EXPECT_EQ(gimi_find(0, "7.17", 0, &peer), GIMI_CLOSED);
  EXPECT_EQ(gimi_find(node_, "7.17", 0, &peer), GIMI_OK);
  EXPECT_EQ(peer, 7u << 20 | 17u);
}

// A program with a newer header reads there what this library does not have.
TEST_F(GimiOptions, TheRoomBehindARecordOfAnEventIsZero) {
  gimi_handle watch = 0;
  gimi_watch_event event{};
  ASSERT_EQ(gimi_watch(node_, "robot", GIMI_WATCH_NODES, 20'000, &watch), GIMI_OK);
  while (event.node == nullptr) {
    gimi_watch_event_release(&event);
    ASSERT_EQ(gimi_watch_receive(watch, 20'000, &event), GIMI_OK);
  }
  const auto* room = reinterpret_cast<const std::byte*>(event.node + 1);
  EXPECT_TRUE(std::all_of(room, room + GIMI_RECORD_ROOM_BYTES,
                          [](std::byte byte) { return byte == std::byte{0}; }));
  gimi_watch_event_release(&event);
  EXPECT_EQ(gimi_close(watch), GIMI_OK);
}

// In C a NUL ends a text: U+FFFD stands for it.
TEST_F(GimiOptions, TextOfCppIsNotCutAtANul) {
  using namespace std::string_literals;
  const Node node("viewer", hub_.url());
  EXPECT_TRUE(node.advertise("a\0b"s).is(Status::bad_name));
  EXPECT_TRUE(node.subscribe("robot/a\0b"s).is(Status::bad_name));
  EXPECT_TRUE(node.find("robot\0"s).is(Status::bad_name));
  EXPECT_TRUE(Node::join({.name = "x\0y"s, .hub = hub_.url()}).is(Status::bad_name));
  const auto publisher = node.advertise("odom", {.metadata = "m\0d"s}).or_throw();
  EXPECT_EQ(node.services("viewer/odom").or_throw().at(0).metadata, "m\uFFFDd");
  EXPECT_TRUE(Node::join({.hub = hub_.url(), .shard = std::uint8_t{255}}).is(Status::bad_argument));
}

}  // namespace
}  // namespace gimnet
