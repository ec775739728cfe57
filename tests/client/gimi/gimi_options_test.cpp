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

// The hub is told the widest of several subscriptions for one name, and so not these.
TEST_F(GimiOptions, AWishOutsideItsRangeIsRefusedBesideAPlainSubscription) {
  gimi_handle plain = 0;
  gimi_handle made_one = 0;
  ASSERT_EQ(gimi_subscribe(node_, "a/b", nullptr, &plain), GIMI_OK);
  const auto refused = [&](const gimi_subscribe_options& options, const char* word) {
    EXPECT_EQ(gimi_subscribe(node_, "a/b", &options, &made_one), GIMI_BAD_ARGUMENT) << word;
    EXPECT_NE(std::strstr(gimi_error_text(), word), nullptr) << gimi_error_text();
    EXPECT_EQ(made_one, 0u);
  };
  auto options = made<gimi_subscribe_options>();
  for (const double rate : {std::nan(""), -1.0, HUGE_VAL, 1000.5, 0.0009}) {
    options.rate_hz = rate;
    refused(options, "rate_hz");
  }
  options = made<gimi_subscribe_options>();
  options.window = 1025;
  refused(options, "window");
  options = made<gimi_subscribe_options>();
  options.depth = 65;
  refused(options, "depth");
  options = made<gimi_subscribe_options>();
  options.queue = GIMI_QUEUE_MESSAGES_MAX + 1;
  refused(options, "16,777,216");
  options = made<gimi_subscribe_options>();
  options.rate_hz = 1000.0;
  options.window = 1024;
  options.depth = 64;
  options.queue = GIMI_QUEUE_MESSAGES_MAX;
  EXPECT_EQ(gimi_subscribe(node_, "a/b", &options, &made_one), GIMI_OK) << gimi_error_text();
  EXPECT_EQ(gimi_close(made_one), GIMI_OK);
  EXPECT_EQ(gimi_close(plain), GIMI_OK);
}

TEST_F(GimiOptions, SizesOverTheMostAreRefused) {
  constexpr std::size_t kTooMany = GIMI_QUEUE_MESSAGES_MAX + 1;
  gimi_handle queue = 0;
  auto queue_options = made<gimi_queue_options>();
  queue_options.messages = kTooMany;
  EXPECT_EQ(gimi_queue(node_, {1, 1}, &queue_options, &queue), GIMI_BAD_ARGUMENT);
  auto accept = made<gimi_accept_options>();
  accept.messages = kTooMany;
  EXPECT_EQ(gimi_accept(node_, "a", &accept, &queue), GIMI_BAD_ARGUMENT);
  ASSERT_EQ(gimi_queue(node_, {1, 1}, nullptr, &queue), GIMI_OK);
  EXPECT_EQ(gimi_resize(queue, kTooMany), GIMI_BAD_ARGUMENT);
  EXPECT_EQ(gimi_resize(queue, kTooMany - 1), GIMI_OK);
  EXPECT_EQ(gimi_close(queue), GIMI_OK);
  auto join = made<gimi_node_options>();
  join.hub = hub_.url().c_str();
  join.queue_messages = kTooMany;
  EXPECT_EQ(gimi_join(&join, &queue), GIMI_BAD_ARGUMENT);
  join.queue_messages = 0;
  join.message_bytes_max = GIMI_MESSAGE_BYTES_MAX + 1;
  EXPECT_EQ(gimi_join(&join, &queue), GIMI_BAD_ARGUMENT);
  const std::string metadata(4097, 'm');
  auto publish = made<gimi_publish_options>();
  publish.metadata = metadata.c_str();
  EXPECT_EQ(gimi_advertise(node_, "a", &publish, &queue), GIMI_BAD_ARGUMENT);
  EXPECT_NE(std::strstr(gimi_error_text(), "metadata"), nullptr) << gimi_error_text();
  EXPECT_EQ(queue, 0u);
}

TEST_F(GimiOptions, AMessageOverOneGibibyteIsRefusedAndNotRead) {
  const char byte = 'x';
  gimi_handle publisher = 0;
  gimi_handle sender = 0;
  gimi_loaned loan{};
  ASSERT_EQ(gimi_advertise(node_, "a", nullptr, &publisher), GIMI_OK);
  gimi_handle subscription = 0;  // without one nothing is sent
  ASSERT_EQ(gimi_subscribe(node_, "robot/a", nullptr, &subscription), GIMI_OK);
  ASSERT_EQ(gimi_wait_for_subscribers(publisher, 1, 20'000), GIMI_OK);
  ASSERT_EQ(gimi_sender(node_, gimi_id(node_), nullptr, &sender), GIMI_OK);
  for (const std::size_t size : {GIMI_MESSAGE_BYTES_MAX + 1, std::size_t{1} << 45, SIZE_MAX}) {
    EXPECT_EQ(gimi_publish(publisher, &byte, size, 1000, 0), GIMI_TOO_LARGE) << size;
    EXPECT_EQ(gimi_loan(publisher, size, &loan), GIMI_TOO_LARGE) << size;
    EXPECT_EQ(gimi_send(sender, &byte, size, 1000, 0), GIMI_TOO_LARGE) << size;
  }
  for (const gimi_handle each : {sender, subscription, publisher})
    EXPECT_EQ(gimi_close(each), GIMI_OK);
}

TEST_F(GimiOptions, ARequestThatIsTooLargeIsNotAnOpenOne) {
  constexpr int kOpenMax = 1024;
  gimi_handle answers = 0;
  gimi_reply reply{};
  ASSERT_EQ(gimi_answer(node_, "add", nullptr, &answers), GIMI_OK);
  for (int i = 0; i <= kOpenMax; ++i) {
    const gimi_bytes data{"x", i % 2 == 0 ? SIZE_MAX : std::size_t{1} << 45};
    ASSERT_EQ(gimi_ask(node_, "robot/add", &data, nullptr, &reply), GIMI_TOO_LARGE) << i;
    ASSERT_EQ(reply.ran, GIMI_RAN_NO);
  }
  gimi_handle pending = 0;
  EXPECT_EQ(gimi_ask_later(node_, "robot/add", nullptr, nullptr, &pending), GIMI_OK)
      << gimi_error_text();
  EXPECT_EQ(gimi_close(pending), GIMI_OK);
  EXPECT_EQ(gimi_close(answers), GIMI_OK);
}

TEST_F(GimiOptions, AFailedCallLeavesItsOutputEmpty) {
  const auto garbage = [] {
    gimi_list list{};
    list.count = 7;
    list.storage = &list;
    return list;
  };
  gimi_list list = garbage();
  EXPECT_EQ(gimi_hub(node_, 77, 0, 0, &list), GIMI_BAD_ARGUMENT);
  EXPECT_EQ(list.storage, nullptr);
  list = garbage();
  EXPECT_EQ(gimi_trace(node_, 1, 0, 0, nullptr, &list), GIMI_BAD_ARGUMENT);
  EXPECT_EQ(list.storage, nullptr);
  gimi_list_release(&list);
  const std::vector<std::function<gimi_status(gimi_handle*)>> calls = {
      [&](gimi_handle* made) { return gimi_advertise(node_, nullptr, nullptr, made); },
      [&](gimi_handle* made) { return gimi_subscribe(node_, nullptr, nullptr, made); },
      [&](gimi_handle* made) { return gimi_accept(node_, nullptr, nullptr, made); },
      [&](gimi_handle* made) { return gimi_answer(node_, nullptr, nullptr, made); },
      [&](gimi_handle* made) { return gimi_sender_to_service(node_, nullptr, nullptr, 0, made); },
  };
  for (const auto& call : calls) {
    gimi_handle made = 77;
    EXPECT_EQ(call(&made), GIMI_BAD_ARGUMENT);
    EXPECT_EQ(made, 0u);
  }
  gimi_peer peer = 77;
  EXPECT_EQ(gimi_find(node_, nullptr, 0, &peer), GIMI_BAD_ARGUMENT);
  EXPECT_EQ(peer, 0u);
  std::size_t count = 77;
  EXPECT_EQ(gimi_wait_set_wait(0, nullptr, 1, sizeof(gimi_ready), 0, &count), GIMI_BAD_ARGUMENT);
  EXPECT_EQ(count, 0u);
}

TEST_F(GimiOptions, SizesWithoutDataAndRecordsOfNoSizeAreRefused) {
  std::int64_t round_trip_ns = 77;
  const gimi_bytes echo{nullptr, 100};
  EXPECT_EQ(gimi_ping(node_, gimi_id(node_), 0, &echo, 100, &round_trip_ns), GIMI_BAD_ARGUMENT);
  gimi_list list{};
  gimi_node_record record{};
  ASSERT_EQ(gimi_nodes(node_, nullptr, 20'000, &list), GIMI_OK);
  EXPECT_EQ(gimi_list_get(&list, 0, &record, SIZE_MAX), GIMI_BAD_ARGUMENT);
  EXPECT_EQ(gimi_list_get(&list, 0, &record, 4097), GIMI_BAD_ARGUMENT);
  gimi_list_release(&list);
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
