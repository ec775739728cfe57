#include "tests/client/gimi/gimi_c_test.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include "gimnet/gimi.h"
#include "tests/client/gimi/support/hub_process.hpp"

// gimnet/gimi.h as programs in C use it; gimi_c_test.c has what they do.

namespace gimnet {
namespace {

TEST(GimiC, AProgramTalks) {
  const test::HubProcess hub;
  EXPECT_EQ(gimi_c_talk(hub.url().c_str()), 0) << gimi_error_text();
}

TEST(GimiC, ABatchHoldsManyMessages) {
  const test::HubProcess hub;
  EXPECT_EQ(gimi_c_batch(hub.url().c_str()), 0) << gimi_error_text();
}

TEST(GimiC, MisuseIsAnswered) {
  const test::HubProcess hub;
  EXPECT_EQ(gimi_c_misuse(hub.url().c_str()), 0) << gimi_error_text();
}

TEST(GimiC, OptionsAndRecordsMayGrow) {
  const test::HubProcess hub;
  EXPECT_EQ(gimi_c_later_versions(hub.url().c_str()), 0) << gimi_error_text();
}

TEST(GimiC, ClosingAHandleEndsTheWaitOfAnotherThread) {
  const test::HubProcess hub;
  gimi_node_options options{};
  options.struct_size = sizeof options;
  options.hub = hub.url().c_str();
  gimi_handle node = 0;
  gimi_handle subscription = 0;
  gimi_handle watch = 0;
  ASSERT_EQ(gimi_join(&options, &node), GIMI_OK);
  ASSERT_EQ(gimi_subscribe(node, "robot/odom", nullptr, &subscription), GIMI_OK);
  ASSERT_EQ(gimi_watch(node, "nobody/*", 0, 5000, &watch), GIMI_OK);
  std::thread receives([&] {
    gimi_message message;
    EXPECT_EQ(gimi_receive(subscription, GIMI_FOREVER, &message), GIMI_CLOSED);
  });
  std::thread watches([&] {
    gimi_watch_event event;
    gimi_status status = GIMI_OK;
    while ((status = gimi_watch_receive(watch, GIMI_FOREVER, &event)) == GIMI_OK)
      gimi_watch_event_release(&event);
    EXPECT_EQ(status, GIMI_CLOSED);
  });
  EXPECT_EQ(gimi_close(subscription), GIMI_OK);
  EXPECT_EQ(gimi_close(watch), GIMI_OK);
  receives.join();
  watches.join();
  EXPECT_EQ(gimi_close(node), GIMI_OK);
}

/// Handles of every kind, of a node that lives.
class GimiMisuse : public testing::Test {
 protected:
  enum Kind : unsigned {
    kNode = 1,
    kPublisher = 2,
    kSubscription = 4,
    kQueue = 8,
    kSender = 16,
    kWatch = 32,
    kPending = 64,
    kAnswers = 128,
    kWaitSet = 256,
    kAccepted = 512,
  };
  struct Call {
    const char* name;
    unsigned takes;
    std::function<gimi_status(gimi_handle)> call;
  };

  void SetUp() override {
    gimi_node_options options{};
    options.struct_size = sizeof options;
    options.hub = hub_.url().c_str();
    options.name = "robot";
    ASSERT_EQ(gimi_join(&options, &node_), GIMI_OK);
    handles_.resize(10);
    handles_[0] = node_;
    ASSERT_EQ(gimi_advertise(node_, "odom", nullptr, &handles_[1]), GIMI_OK);
    ASSERT_EQ(gimi_subscribe(node_, "robot/odom", nullptr, &handles_[2]), GIMI_OK);
    ASSERT_EQ(gimi_queue(node_, {1, 2}, nullptr, &handles_[3]), GIMI_OK);
    ASSERT_EQ(gimi_sender(node_, gimi_id(node_), nullptr, &handles_[4]), GIMI_OK);
    ASSERT_EQ(gimi_watch(node_, nullptr, 0, 5000, &handles_[5]), GIMI_OK);
    ASSERT_EQ(gimi_answer(node_, "add", nullptr, &handles_[7]), GIMI_OK);
    ASSERT_EQ(gimi_ask_later(node_, "robot/add", nullptr, nullptr, &handles_[6]), GIMI_OK);
    ASSERT_EQ(gimi_wait_set_create(&handles_[8]), GIMI_OK);
    ASSERT_EQ(gimi_accept(node_, "drive", nullptr, &handles_[9]), GIMI_OK);
  }
  void TearDown() override {
    for (std::size_t i = handles_.size(); i-- > 0;) EXPECT_EQ(gimi_close(handles_[i]), GIMI_OK);
  }
  /// The call fails so, and says why in a sentence of its own.
  static void expect(const char* what, gimi_status expected,
                     const std::function<gimi_status()>& call) {
    EXPECT_EQ(gimi_list_get(nullptr, 7, nullptr, 0), GIMI_BAD_ARGUMENT);
    const std::string before = gimi_error_text();
    EXPECT_EQ(call(), expected) << what;
    EXPECT_NE(gimi_error_text(), before) << what;
    EXPECT_GT(std::string(gimi_error_text()).size(), 15u) << what << ": " << gimi_error_text();
  }
  /// Not what gimi_c_test.c calls with such handles.
  static std::vector<Call> calls();

  test::HubProcess hub_;
  gimi_handle node_ = 0;
  std::vector<gimi_handle> handles_;  ///< in the order of Kind
};

std::vector<GimiMisuse::Call> GimiMisuse::calls() {
  static gimi_handle made;
  static gimi_message message;
  static gimi_batch batch;
  static gimi_queue_counts counts{sizeof counts, 0, 0, 0, 0};
  static gimi_reply reply;
  static gimi_request request;
  static gimi_watch_event event;
  static gimi_connection_event connection{sizeof connection, 0, 0, 0, {}};
  static gimi_loaned loan;
  static gimi_ready ready;
  static std::size_t number;
  static std::int32_t descriptor;
  static std::array<char, 8> text;
  constexpr unsigned kQueues = kSubscription | kQueue | kAccepted;
  using H = gimi_handle;
  return {
      {"leave", kNode, [](H h) { return gimi_leave(h); }},
      {"ask", kNode, [](H h) { return gimi_ask(h, "a/b", nullptr, nullptr, &reply); }},
      {"ask_later", kNode, [](H h) { return gimi_ask_later(h, "a/b", nullptr, nullptr, &made); }},
      {"answer", kNode, [](H h) { return gimi_answer(h, "a", nullptr, &made); }},
      {"advertise", kNode, [](H h) { return gimi_advertise(h, "a", nullptr, &made); }},
      {"subscribe", kNode, [](H h) { return gimi_subscribe(h, "a/b", nullptr, &made); }},
      {"accept", kNode, [](H h) { return gimi_accept(h, "a", nullptr, &made); }},
      {"sender", kNode, [](H h) { return gimi_sender(h, 1, nullptr, &made); }},
      {"watch", kNode, [](H h) { return gimi_watch(h, nullptr, 0, 0, &made); }},
      {"watch_connection", kNode, [](H h) { return gimi_watch_connection(h, &made); }},
      {"connection_receive", 0, [](H h) { return gimi_connection_receive(h, 0, &connection); }},
      {"subscribers_changed", kPublisher,
       [](H h) { return gimi_subscribers_changed(h, 0, &number); }},
      {"publish", kPublisher, [](H h) { return gimi_publish(h, "x", 1, 0, 0); }},
      {"loan", kPublisher, [](H h) { return gimi_loan(h, 1, &loan); }},
      {"send", kSender, [](H h) { return gimi_send(h, "x", 1, 0, 0); }},
      {"receive", kQueues | kNode, [](H h) { return gimi_receive(h, 0, &message); }},
      {"receive_newest", kQueues, [](H h) { return gimi_receive_newest(h, &message); }},
      {"receive_packed", kQueues, [](H h) { return gimi_receive_packed(h, 1, 0, &batch); }},
      {"resize", kQueues, [](H h) { return gimi_resize(h, 1); }},
      {"counts", kQueues, [](H h) { return gimi_counts(h, &counts); }},
      {"standing", kPublisher | kSubscription | kAccepted, [](H h) { return gimi_standing(h); }},
      {"service_name", kPublisher | kSubscription | kSender | kAccepted,
       [](H h) { return gimi_service_name(h, text.data(), text.size()); }},
      {"watch_receive", kWatch, [](H h) { return gimi_watch_receive(h, 0, &event); }},
      {"wait_for_reply", kPending, [](H h) { return gimi_wait_for_reply(h, 0, &reply); }},
      {"next_request", kAnswers, [](H h) { return gimi_next_request(h, 0, &request); }},
      {"wait", kWaitSet,
       [](H h) { return gimi_wait_set_wait(h, &ready, 1, sizeof ready, 0, &number); }},
      {"wait_add", kWaitSet, [](H h) { return gimi_wait_set_add(h, h, 1); }},
      {"wait_remove", kWaitSet, [](H h) { return gimi_wait_set_remove(h, h); }},
      {"wake", kWaitSet, [](H h) { return gimi_wait_set_wake(h); }},
      {"descriptor", kWaitSet, [](H h) { return gimi_wait_set_descriptor(h, &descriptor); }},
  };
}

TEST_F(GimiMisuse, HandlesOfAnotherKindAreRefused) {
  for (const Call& each : calls()) {
    for (std::size_t i = 0; i < handles_.size(); ++i) {
      if ((each.takes >> i & 1) != 0) continue;
      expect(each.name, GIMI_BAD_ARGUMENT, [&] { return each.call(handles_[i]); });
    }
  }
}

TEST_F(GimiMisuse, HandlesThatWereClosedOrNeverGivenAreRefused) {
  std::vector<gimi_handle> closed = handles_;
  TearDown();
  SetUp();  // the slots have other handles now
  closed.insert(closed.end(), {0, 1, UINT64_MAX, handles_[2] ^ (1u << 24)});
  for (const gimi_handle handle : closed) {
    EXPECT_EQ(gimi_close(handle), GIMI_CLOSED);
    for (const Call& each : calls())
      expect(each.name, GIMI_CLOSED, [&] { return each.call(handle); });
  }
}

TEST_F(GimiMisuse, PointersThatAreNullAreRefused) {
  gimi_loaned loan{};
  gimi_ready ready{};
  std::size_t number = 0;
  const gimi_bytes no_bytes{nullptr, 1};
  gimi_handle made = 0;
  gimi_reply reply{};
  const std::vector<std::function<gimi_status()>> calls = {
      [&] { return gimi_join(nullptr, nullptr); },
      [&] { return gimi_advertise(node_, nullptr, nullptr, &made); },
      [&] { return gimi_advertise(node_, "a", nullptr, nullptr); },
      [&] { return gimi_publish(handles_[1], nullptr, 1, 0, 0); },
      [&] { return gimi_publish_many(handles_[1], nullptr, 1, 0, nullptr); },
      [&] { return gimi_publish_many(handles_[1], &no_bytes, 1, 0, nullptr); },
      [&] { return gimi_loan(handles_[1], 1, nullptr); },
      [&] { return gimi_publish_loan(handles_[1], nullptr, 0, 0); },
      [&] { return gimi_publish_loan(handles_[1], &loan, 0, 0); },
      [&] { return gimi_subscribe(node_, nullptr, nullptr, &made); },
      [&] { return gimi_subscribe(node_, "a/b", nullptr, nullptr); },
      [&] { return gimi_accept(node_, nullptr, nullptr, &made); },
      [&] { return gimi_accept(node_, "a", nullptr, nullptr); },
      [&] { return gimi_sender(node_, 1, nullptr, nullptr); },
      [&] { return gimi_send(handles_[4], nullptr, 1, 0, 0); },
      [&] { return gimi_send_to(node_, 1, &no_bytes, nullptr, 0); },
      [&] { return gimi_receive(node_, 0, nullptr); },
      [&] { return gimi_receive_newest(handles_[2], nullptr); },
      [&] { return gimi_receive_packed(handles_[2], 1, 0, nullptr); },
      [&] { return gimi_counts(handles_[2], nullptr); },
      [&] { return gimi_find(node_, nullptr, 0, nullptr); },
      [&] { return gimi_nodes(node_, nullptr, 0, nullptr); },
      [&] { return gimi_watch(node_, nullptr, 0, 0, nullptr); },
      [&] { return gimi_watch_receive(handles_[5], 0, nullptr); },
      [&] { return gimi_subscribers_changed(handles_[1], 0, nullptr); },
      [&] { return gimi_ask(node_, "a/b", nullptr, nullptr, nullptr); },
      [&] { return gimi_ask(node_, nullptr, nullptr, nullptr, &reply); },
      [&] { return gimi_ask(node_, "a/b", &no_bytes, nullptr, &reply); },
      [&] { return gimi_ask_later(node_, "a/b", nullptr, nullptr, nullptr); },
      [&] { return gimi_wait_for_reply(handles_[6], 0, nullptr); },
      [&] { return gimi_answer(node_, "a", nullptr, nullptr); },
      [&] { return gimi_next_request(handles_[7], 0, nullptr); },
      [&] { return gimi_reply_to(nullptr, "x", 1, 0); },
      [&] { return gimi_fail_request(nullptr, 1, nullptr); },
      [&] { return gimi_wait_set_create(nullptr); },
      [&] { return gimi_wait_set_wait(handles_[8], nullptr, 1, sizeof ready, 0, &number); },
      [&] { return gimi_wait_set_wait(handles_[8], &ready, 1, sizeof ready, 0, nullptr); },
      [&] { return gimi_wait_set_descriptor(handles_[8], nullptr); },
  };
  for (std::size_t i = 0; i < calls.size(); ++i)
    expect(std::to_string(i).c_str(), GIMI_BAD_ARGUMENT, calls[i]);
  gimi_reply_release(nullptr);
  gimi_request_release(nullptr);
  gimi_message_release(nullptr);
  gimi_loan_release(nullptr);
}

TEST_F(GimiMisuse, EventsOfAConnectionNeedAPlaceOfASize) {
  gimi_connection_event unsized{};
  gimi_handle connection = 0;
  EXPECT_EQ(gimi_watch_connection(node_, nullptr), GIMI_BAD_ARGUMENT);
  ASSERT_EQ(gimi_watch_connection(node_, &connection), GIMI_OK);
  EXPECT_EQ(gimi_connection_receive(connection, 0, nullptr), GIMI_BAD_ARGUMENT);
  EXPECT_EQ(gimi_connection_receive(connection, 0, &unsized), GIMI_BAD_ARGUMENT);
  EXPECT_EQ(gimi_close(connection), GIMI_OK);
}

template <class Options, class Call>
void refuses_sizes(const Call& call) {
  for (const std::size_t size : {std::size_t{0}, std::size_t{1} << 32, SIZE_MAX}) {
    Options options{};
    options.struct_size = size;
    EXPECT_EQ(call(&options), GIMI_BAD_ARGUMENT) << size << gimi_error_text();
  }
}

TEST_F(GimiMisuse, OptionsOfWrongSizesAreRefused) {
  gimi_handle made = 0;
  gimi_reply reply{};
  refuses_sizes<gimi_node_options>([&](auto* how) { return gimi_join(how, &made); });
  refuses_sizes<gimi_publish_options>(
      [&](auto* how) { return gimi_advertise(node_, "a", how, &made); });
  refuses_sizes<gimi_subscribe_options>(
      [&](auto* how) { return gimi_subscribe(node_, "a/b", how, &made); });
  refuses_sizes<gimi_accept_options>(
      [&](auto* how) { return gimi_accept(node_, "a", how, &made); });
  refuses_sizes<gimi_send_options>([&](auto* how) { return gimi_sender(node_, 1, how, &made); });
  refuses_sizes<gimi_queue_options>(
      [&](auto* how) { return gimi_queue(node_, {1, 1}, how, &made); });
  refuses_sizes<gimi_request_options>(
      [&](auto* how) { return gimi_ask(node_, "a/b", nullptr, how, &reply); });
  refuses_sizes<gimi_answer_options>(
      [&](auto* how) { return gimi_answer(node_, "a", how, &made); });
  EXPECT_EQ(made, 0u);
}

TEST_F(GimiMisuse, NamesThatAreTooLongAreRefused) {
  const std::string name(300, 'n');
  const std::string full = "robot/" + name;
  gimi_handle made = 0;
  gimi_reply reply{};
  gimi_peer peer = 0;
  expect("advertise", GIMI_BAD_NAME,
         [&] { return gimi_advertise(node_, name.c_str(), nullptr, &made); });
  expect("accept", GIMI_BAD_NAME, [&] { return gimi_accept(node_, name.c_str(), nullptr, &made); });
  expect("answer", GIMI_BAD_NAME, [&] { return gimi_answer(node_, name.c_str(), nullptr, &made); });
  expect("subscribe", GIMI_BAD_NAME,
         [&] { return gimi_subscribe(node_, full.c_str(), nullptr, &made); });
  expect("ask", GIMI_BAD_NAME,
         [&] { return gimi_ask(node_, full.c_str(), nullptr, nullptr, &reply); });
  expect("find", GIMI_BAD_NAME, [&] { return gimi_find(node_, name.c_str(), 5000, &peer); });
  expect("take_name", GIMI_BAD_NAME, [&] { return gimi_take_name(node_, name.c_str(), 5000); });
  expect("watch", GIMI_BAD_NAME, [&] { return gimi_watch(node_, name.c_str(), 0, 5000, &made); });
}

TEST_F(GimiMisuse, NumbersOutsideTheirRangesAreRefused) {
  gimi_handle made = 0;
  for (const double rate : {std::nan(""), -1.0, std::numeric_limits<double>::infinity()}) {
    gimi_subscribe_options options{};
    options.struct_size = sizeof options;
    options.rate_hz = rate;
    expect("rate_hz", GIMI_BAD_ARGUMENT,
           [&] { return gimi_subscribe(node_, "a/b", &options, &made); });
  }
  for (const std::int32_t wrong : {-1, 77}) {
    gimi_publish_options publish{};
    publish.struct_size = sizeof publish;
    publish.delivery = wrong;
    expect("delivery", GIMI_BAD_ARGUMENT,
           [&] { return gimi_advertise(node_, "a", &publish, &made); });
    gimi_send_options send{};
    send.struct_size = sizeof send;
    send.lane = wrong;
    expect("lane", GIMI_BAD_ARGUMENT, [&] { return gimi_sender(node_, 1, &send, &made); });
    send.lane = 0;
    send.at_full = wrong;
    expect("at_full", GIMI_BAD_ARGUMENT, [&] { return gimi_sender(node_, 1, &send, &made); });
    gimi_queue_options queue{};
    queue.struct_size = sizeof queue;
    queue.at_full = wrong;
    expect("at_full", GIMI_BAD_ARGUMENT, [&] { return gimi_queue(node_, {1, 1}, &queue, &made); });
    gimi_subscribe_options subscribe{};
    subscribe.struct_size = sizeof subscribe;
    subscribe.at_full = wrong;
    expect("at_full", GIMI_BAD_ARGUMENT,
           [&] { return gimi_subscribe(node_, "a/b", &subscribe, &made); });
    gimi_accept_options accept{};
    accept.struct_size = sizeof accept;
    accept.at_full = wrong;
    expect("at_full", GIMI_BAD_ARGUMENT, [&] { return gimi_accept(node_, "b", &accept, &made); });
    gimi_request_options ask{};
    ask.struct_size = sizeof ask;
    ask.lane = wrong;
    gimi_reply reply{};
    expect("lane", GIMI_BAD_ARGUMENT,
           [&] { return gimi_ask(node_, "robot/add", nullptr, &ask, &reply); });
  }
}

// Every negative time is without a limit: these have their answers at once.
TEST_F(GimiMisuse, NegativeTimesHaveNoLimit) {
  gimi_peer peer = 0;
  gimi_list list{};
  for (const std::int32_t time : {-1, -77, std::numeric_limits<std::int32_t>::min()}) {
    EXPECT_EQ(gimi_find(node_, "robot", time, &peer), GIMI_OK);
    EXPECT_EQ(gimi_nodes(node_, nullptr, time, &list), GIMI_OK);
    gimi_list_release(&list);
    EXPECT_EQ(gimi_publish(handles_[1], "x", 1, time, 0), GIMI_OK);
  }
}

}  // namespace
}  // namespace gimnet
