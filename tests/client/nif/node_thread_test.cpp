#include <gtest/gtest.h>
#include <poll.h>

#include <atomic>
#include <chrono>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "client/nif/handles.hpp"
#include "client/nif/node.hpp"
#include "proto/frame/extensions.hpp"
#include "tests/client/nif/support/fake_hub.hpp"
#include "tests/client/nif/support/recording_host.hpp"

// Tests the work of the library's thread by itself: keep-alive, silence, a full receive queue, a
// hub that misbehaves.

namespace gimnet::nif::test {
namespace {

void add_message(std::vector<std::byte>& bytes, std::string_view payload) {
  proto::FrameParts parts;
  parts.header.dst = kOwnId;
  parts.header.src = kPeerId;
  add_frame(bytes, parts, payload);
}

TEST(NodeThread, PingsWhenItHasSentNothingAndAnswersPings) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(connected.hub.next_flow<proto::flow::Ping>());
  connected.hub.send(proto::flow::Ping{5, 6});
  const auto pong = connected.hub.next_flow<proto::flow::Pong>();
  ASSERT_TRUE(pong);
  EXPECT_EQ(pong->sequence, 5u);
  EXPECT_EQ(pong->sent_ns, 6);
}

// The hub PINGs first, and the node always has something to write.
TEST(NodeThread, FollowsTheHubsClockWhileItIsBusy) {
  FakeHub hub;
  proto::Welcome welcome = make_welcome();
  welcome.hub_time_ns = wall_now_ns();
  Connected connected = connect_to(hub, default_options(), welcome);
  nif_outgoing message = NIF_OUTGOING_INIT;
  message.to = kPeerId;
  message.age_ms_max = 100;
  constexpr std::int64_t kHourNs = 3'600'000'000'000;
  for (const std::int64_t ahead_ns : {kHourNs, -kHourNs}) {
    const Deadline until = steady_now_ns() + std::chrono::nanoseconds(kPatience).count();
    for (bool followed = false; !followed;) {
      ASSERT_LT(steady_now_ns(), until) << ahead_ns;
      ASSERT_EQ(nif_send(connected.node.get(), &message, NIF_FOREVER), NIF_OK);
      const auto frame = connected.hub.next();
      ASSERT_TRUE(frame) << ahead_ns;
      if (const auto flow = frame->flow(); frame->header.kind == proto::Kind::flow) {
        const auto* ping = std::get_if<proto::flow::Ping>(&*flow);
        if (ping == nullptr) continue;
        connected.hub.send(
            proto::flow::Pong{ping->sequence, ping->sent_ns, wall_now_ns() + ahead_ns});
        continue;
      }
      const auto age = proto::find_age(frame->view().extensions);
      ASSERT_TRUE(age);
      const std::int64_t apart_ns = age->origin_ns - (wall_now_ns() + ahead_ns);
      followed = apart_ns > -kHourNs / 2 && apart_ns < kHourNs / 2;
    }
  }
}

TEST(NodeThread, ConfirmsWithEveryKeepAliveAndEachQuarter) {
  FakeHub hub;
  proto::Welcome welcome = make_welcome(1000);
  Connected connected = connect_to(hub, default_options("robot"), welcome);
  connected.hub.send_unicast(kPeerId, kOwnId, "a");
  auto confirm = connected.hub.next_flow<proto::flow::Confirm>();
  ASSERT_TRUE(confirm);
  EXPECT_EQ(confirm->count, 1u);
  connected.hub.send_unicast(kPeerId, kOwnId, std::string(300, 'x'));
  confirm = connected.hub.next_flow<proto::flow::Confirm>();
  ASSERT_TRUE(confirm);
  EXPECT_EQ(confirm->count, 2u);
}

/// Counts its runs, and wants the next one in a millisecond.
class CountingTask {
 public:
  explicit CountingTask(nif_node* node) : node_(share_node(node)) {
    node_->thread().set_task([this] {
      runs_.fetch_add(1);
      return steady_now_ns() + kNsPerMs;
    });
  }
  ~CountingTask() {
    node_->thread().set_task({});
    node_->drop();
  }
  CountingTask(const CountingTask&) = delete;
  CountingTask& operator=(const CountingTask&) = delete;
  /// Waits for so many more. False: not within kPatience, or the hub's end hears something first.
  bool runs(int more, const FakeConnection& hub) const {
    const int wanted = runs_.load() + more;
    const Deadline until = steady_now_ns() + std::chrono::nanoseconds(kPatience).count();
    while (runs_.load() < wanted && steady_now_ns() < until) {
      pollfd heard{hub.descriptor(), POLLIN, 0};
      if (::poll(&heard, 1, 1) > 0) return false;
    }
    return runs_.load() >= wanted;
  }

 private:
  Node* const node_;
  std::atomic<int> runs_{0};
};

TEST(NodeThread, RunsATaskWhenItIsDue) {
  FakeHub hub;
  proto::Welcome welcome = make_welcome();
  welcome.keep_alive_ms = 60'000;
  const Connected connected = connect_to(hub, default_options(), welcome);
  const CountingTask task(connected.node.get());
  EXPECT_TRUE(task.runs(3, connected.hub)) << "nothing else wakes the thread";
}

TEST(NodeThread, RunsATaskWhileAHubDoesNotAnswer) {
  FakeHub hub;
  nif_options options = default_options();
  options.no_reconnect = 0;
  Connected connected = connect_to(hub, options, make_welcome());
  const CountingTask task(connected.node.get());
  connected.hub.close();
  FakeConnection silent = hub.accept();
  ASSERT_TRUE(silent.read_hello());
  EXPECT_TRUE(task.runs(3, silent)) << "before it gives up";
}

// Its own thread is woken all the time, and always has something to read.
TEST(NodeThread, KeepsAliveWhileAFloodComes) {
  constexpr std::int64_t kIntervalNs = 200 * kNsPerMs;
  FakeHub hub;
  nif_options options = default_options();
  options.callback = [](void*, const nif_incoming*) { return NIF_DONE; };
  proto::Welcome welcome = make_welcome();
  welcome.keep_alive_ms = kIntervalNs / kNsPerMs;
  Connected connected = connect_to(hub, options, welcome);
  Node* const node = share_node(connected.node.get());
  std::atomic<bool> over{false};
  std::thread flood([&] {
    while (!over.load()) {
      for (int i = 0; i < 100; ++i) connected.hub.send_unicast(kPeerId, kOwnId, "flood");
      node->thread().rouse();
    }
  });
  // Each five intervals it sends one in any case, to measure the hub's clock.
  const Deadline until = steady_now_ns() + std::chrono::nanoseconds(kPatience).count();
  int in_time = 0;
  for (std::int64_t last = INT64_MIN / 2; in_time < 3 && steady_now_ns() < until;) {
    if (!connected.hub.next_flow<proto::flow::Ping>()) break;
    const std::int64_t apart_ns = steady_now_ns() - std::exchange(last, steady_now_ns());
    in_time = apart_ns < 3 * kIntervalNs ? in_time + 1 : 0;
  }
  EXPECT_EQ(in_time, 3) << "one after the other";
  over.store(true);
  flood.join();
  node->drop();
}

TEST(NodeThread, LeavesAHubThatIsSilent) {
  FakeHub hub;
  proto::Welcome welcome = make_welcome();
  welcome.silent_ms = 100;
  Connected connected = connect_to(hub, default_options(), welcome);
  EXPECT_TRUE(connected.hub.wait_closed());
  nif_incoming in;
  ASSERT_EQ(nif_receive(connected.node.get(), &in, NIF_FOREVER), NIF_OK);
  EXPECT_EQ(in.type, static_cast<std::uint32_t>(NIF_DISCONNECTED));
  EXPECT_EQ(in.reason, static_cast<std::uint32_t>(proto::GoodbyeCode::silent));
  nif_release(&in);
}

TEST(NodeThread, StopsReadingWhenTheProgramDoesNotTakeAndKeepsAlive) {
  FakeHub hub;
  nif_options options = default_options();
  options.receive_queue_bytes = 100'000;
  options.socket_receive_bytes = 4096;
  proto::Welcome welcome = make_welcome();
  welcome.silent_ms = 200;
  Connected connected = connect_to(hub, options, welcome);
  constexpr int kMessages = 1000;
  std::thread sending([&] {
    for (int i = 0; i < kMessages; ++i)
      connected.hub.send_unicast(kPeerId, kOwnId, std::string(4000, 'x'));
  });
  while (counters_of(connected.node.get()).read_stops == 0) std::this_thread::yield();
  const std::size_t slack = 256 * 1024;  // what one read may bring
  EXPECT_LE(counters_of(connected.node.get()).receive_queue_bytes, 100'000 + slack);
  for (int i = 0; i < 10; ++i) {
    ASSERT_TRUE(connected.hub.next_flow<proto::flow::Ping>()) << "it goes on after the silent time";
  }
  EXPECT_EQ(info_of(connected.node.get()).connected, 1);
  for (int i = 0; i < kMessages; ++i) {
    nif_incoming in;
    ASSERT_EQ(nif_receive(connected.node.get(), &in, 20'000), NIF_OK);
    ASSERT_EQ(in.type, static_cast<std::uint32_t>(NIF_MESSAGE)) << in.text;
    nif_release(&in);
  }
  sending.join();
}

TEST(NodeThread, EndsAConnectionOnWhichTheHubBreaksTheProtocol) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  for (int i = 0; i < 3; ++i) {
    connected.hub.send_unicast(kPeerId, kOwnId, "before");
    std::vector<std::byte> garbage(64, std::byte{0xFF});
    connected.hub.send(garbage);
    EXPECT_TRUE(connected.hub.wait_closed());
    connected.hub = hub.admit(make_welcome());
    nif_incoming in;
    for (const auto type : {NIF_MESSAGE, NIF_DISCONNECTED, NIF_CONNECTED}) {
      ASSERT_EQ(nif_receive(connected.node.get(), &in, 20'000), NIF_OK);
      EXPECT_EQ(in.type, static_cast<std::uint32_t>(type));
      nif_release(&in);
    }
  }
}

TEST(NodeThread, ConfirmationOfWhatWasNeverSentEndsTheConnection) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options("robot"), make_welcome(1000));
  connected.hub.send(proto::flow::Confirm{1});
  EXPECT_TRUE(connected.hub.wait_closed());
}

/// The events of the answers of one read stand between the messages of that read.
TEST(NodeThread, TellsEventsAndMessagesInTheOrderInWhichTheyCame) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options("robot"), make_welcome());
  nif_node* const node = connected.node.get();
  std::uint16_t advertised = 0;
  std::uint16_t subscribed = 0;
  std::thread declaring([node] {
    nif_service service{};
    service.struct_size = sizeof service;
    service.name = "odom";
    std::uint32_t group = 0;
    EXPECT_EQ(nif_advertise(node, &service, &group, nullptr, NIF_FOREVER), NIF_OK);
  });
  ASSERT_TRUE(connected.hub.next_request<proto::ns::Advertise>(advertised));
  connected.hub.send_control(
      proto::Kind::ns,
      proto::encode_answer(proto::ns::AdvertiseAnswer{GroupId{11}, 0}, advertised));
  declaring.join();
  std::thread subscribing(
      [node] { EXPECT_EQ(nif_subscribe(node, "peer/scan", nullptr, NIF_FOREVER), NIF_OK); });
  ASSERT_TRUE(connected.hub.next_request<proto::ns::Subscribe>(subscribed));
  connected.hub.send_control(proto::Kind::ns,
                             proto::encode_answer(proto::ns::SubscribeAnswer{}, subscribed));
  subscribing.join();
  connected.hub.close();
  connected.hub = hub.admit(make_welcome());
  ASSERT_TRUE(connected.hub.next_request<proto::ns::Advertise>(advertised));
  ASSERT_TRUE(connected.hub.next_request<proto::ns::Subscribe>(subscribed));
  std::vector<std::byte> bytes;
  add_message(bytes, "1");
  add_control(bytes, proto::Kind::ns,
              proto::encode_answer(proto::ns::AdvertiseAnswer{GroupId{12}, 0}, advertised));
  add_message(bytes, "2");
  proto::ns::SubscribeAnswer answer;
  answer.group = GroupId{22};
  add_control(bytes, proto::Kind::ns, proto::encode_answer(answer, subscribed));
  add_message(bytes, "3");
  connected.hub.send(bytes);
  for (const auto type : {NIF_DISCONNECTED, NIF_CONNECTED, NIF_MESSAGE, NIF_OWN_SERVICE_MOVED,
                          NIF_SUBSCRIBERS, NIF_MESSAGE, NIF_SERVICE_MOVED, NIF_MESSAGE}) {
    nif_incoming in;
    ASSERT_EQ(nif_receive(node, &in, NIF_FOREVER), NIF_OK);
    EXPECT_EQ(in.type, static_cast<std::uint32_t>(type));
    EXPECT_NE(in.arrival_ns, 0) << in.type;
    nif_release(&in);
  }
}

/// Opening, WELCOME, a message and what `add` puts behind it, in one write.
template <class Add>
FakeConnection admit_with(FakeHub& hub, const Add& add) {
  FakeConnection connection = hub.accept();
  EXPECT_TRUE(connection.read_hello());
  std::vector<std::byte> bytes(proto::kOpening.begin(), proto::kOpening.end());
  add_control(bytes, proto::Kind::link, proto::encode(make_welcome()));
  add_message(bytes, "at once");
  add(bytes);
  connection.send(bytes);
  return connection;
}

void add_goodbye(std::vector<std::byte>& bytes, proto::GoodbyeCode code) {
  add_control(bytes, proto::Kind::link, proto::encode(proto::Goodbye{code, "go away"}));
}

/// A node that dials a hub on which a test lets it in.
template <class Add>
Connected connect_with(FakeHub& hub, const Add& add) {
  nif_options options = default_options();
  const std::string url = hub.url();
  options.url = url.c_str();
  nif_node* node = nullptr;
  std::thread dialing([&] { EXPECT_EQ(nif_connect(&options, &node), NIF_OK) << nif_error_text(); });
  FakeConnection connection = admit_with(hub, add);
  dialing.join();
  return {OpenNode(node), std::move(connection), {}};
}

void expect_event(nif_node* node, nif_incoming_type type, proto::GoodbyeCode reason = {},
                  bool for_good = false) {
  nif_incoming in{};
  ASSERT_EQ(nif_receive(node, &in, NIF_FOREVER), NIF_OK);
  EXPECT_EQ(in.type, static_cast<std::uint32_t>(type));
  if (type == NIF_DISCONNECTED) {
    EXPECT_EQ(in.reason, static_cast<std::uint32_t>(reason)) << in.text;
    EXPECT_EQ((in.flags & NIF_DISCONNECTED_FOR_GOOD) != 0, for_good) << in.text;
  }
  if (type == NIF_MESSAGE) {
    EXPECT_EQ(payload_of(in), "at once");
  }
  nif_release(&in);
}

TEST(NodeThread, WhatFollowsWelcomeAtOnceIsNotLost) {
  FakeHub hub;
  const Connected connected = connect_with(hub, [](auto&) {});
  expect_event(connected.node.get(), NIF_MESSAGE);
  while (counters_of(connected.node.get()).messages_received == 0) std::this_thread::yield();
  EXPECT_GT(counters_of(connected.node.get()).bytes_received, 0u);
}

TEST(NodeThread, AGoodbyeBehindTheFirstWelcomeIsAGoodbye) {
  FakeHub hub;
  Connected connected =
      connect_with(hub, [](auto& bytes) { add_goodbye(bytes, proto::GoodbyeCode::kicked); });
  nif_node* const node = connected.node.get();
  expect_event(node, NIF_MESSAGE);
  expect_event(node, NIF_DISCONNECTED, proto::GoodbyeCode::kicked, true);
  nif_incoming in{};
  EXPECT_EQ(nif_receive(node, &in, NIF_FOREVER), NIF_REFUSED) << "and it does not come back";
  EXPECT_EQ(info_of(node).ended, 1);
}

TEST(NodeThread, AGoodbyeBehindALaterWelcomeIsAGoodbye) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_node* const node = connected.node.get();
  connected.hub.close();
  expect_event(node, NIF_DISCONNECTED, proto::GoodbyeCode::done);
  for (const auto code : {proto::GoodbyeCode::draining, proto::GoodbyeCode::kicked}) {
    connected.hub = admit_with(hub, [code](auto& bytes) { add_goodbye(bytes, code); });
    expect_event(node, NIF_CONNECTED);
    expect_event(node, NIF_MESSAGE);
    expect_event(node, NIF_DISCONNECTED, code, code == proto::GoodbyeCode::kicked);
  }
  nif_incoming in{};
  EXPECT_EQ(nif_receive(node, &in, NIF_FOREVER), NIF_REFUSED) << "and it does not come back";
}

TEST(NodeThread, WhatIsWrongBehindWelcomeEndsTheConnection) {
  FakeHub hub;
  const auto add_garbage = [](auto& bytes) { bytes.insert(bytes.end(), 64, std::byte{0xFF}); };
  Connected connected = connect_with(hub, add_garbage);
  nif_node* const node = connected.node.get();
  for (int i = 0; i < 2; ++i) {
    expect_event(node, NIF_MESSAGE);
    expect_event(node, NIF_DISCONNECTED, proto::GoodbyeCode::malformed);
    EXPECT_TRUE(connected.hub.wait_closed());
    connected.hub = admit_with(hub, add_garbage);
    expect_event(node, NIF_CONNECTED);
  }
}

}  // namespace
}  // namespace gimnet::nif::test
