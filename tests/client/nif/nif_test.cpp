#include "gimnet/nif.h"

#include <gtest/gtest.h>
#include <poll.h>

#include <atomic>
#include <string>
#include <thread>
#include <vector>

#include "base/clock.hpp"
#include "proto/frame/extensions.hpp"
#include "tests/client/nif/support/fake_hub.hpp"

namespace gimnet::nif::test {
namespace {

/// No keep-alive falls into what is counted.
proto::Welcome quiet_welcome() {
  proto::Welcome welcome = make_welcome();
  welcome.keep_alive_ms = 30'000;
  return welcome;
}

TEST(Nif, ConnectsSendsReceivesAndSaysGoodbye) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options("robot"), make_welcome());
  EXPECT_EQ(connected.hello.name, "robot");
  EXPECT_EQ(nif_id(connected.node.get()), kOwnId);

  ASSERT_EQ(nif_send_to(connected.node.get(), kPeerId, "hi", 2), NIF_OK);
  const auto frame = connected.hub.next_message();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->header.kind, proto::Kind::unicast);
  EXPECT_EQ(frame->header.src, kOwnId);
  EXPECT_EQ(frame->header.dst, kPeerId);
  EXPECT_EQ(frame->header.lane, NIF_NORMAL);
  EXPECT_EQ(frame->payload(), "hi");

  connected.hub.send_unicast(kPeerId, kOwnId, "hello");
  nif_incoming in;
  ASSERT_EQ(nif_receive(connected.node.get(), &in, NIF_FOREVER), NIF_OK);
  EXPECT_EQ(in.type, static_cast<std::uint32_t>(NIF_MESSAGE));
  EXPECT_EQ(in.from, kPeerId);
  EXPECT_EQ(payload_of(in), "hello");
  nif_release(&in);

  std::thread closing([&] { EXPECT_EQ(nif_close(connected.node.release()), NIF_OK); });
  const auto last = connected.hub.next_message();
  ASSERT_TRUE(last);
  EXPECT_EQ(last->header.kind, proto::Kind::link);
  EXPECT_TRUE(proto::decode<proto::Goodbye>(last->view().payload));
  connected.hub.close();
  closing.join();
}

TEST(Nif, OneSmallMessageIsOneSystemCall) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), quiet_welcome());
  const nif_counters before = counters_of(connected.node.get());
  ASSERT_EQ(nif_send_to(connected.node.get(), kPeerId, "hi", 2), NIF_OK);
  const nif_counters after = counters_of(connected.node.get());
  EXPECT_EQ(after.frames_sent - before.frames_sent, 1u);
  EXPECT_EQ(after.write_calls - before.write_calls, 1u);
}

TEST(Nif, GathersWhatIsSentWithMore) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), quiet_welcome());
  const nif_counters before = counters_of(connected.node.get());
  nif_outgoing message = NIF_OUTGOING_INIT;
  message.to = kPeerId;
  constexpr int kMessages = 1000;
  for (int i = 0; i < kMessages; ++i) {
    message.flags = i + 1 < kMessages ? NIF_FLAG_MORE : 0;
    ASSERT_EQ(nif_send(connected.node.get(), &message, NIF_FOREVER), NIF_OK);
  }
  for (int i = 0; i < kMessages; ++i) ASSERT_TRUE(connected.hub.next_message());
  const nif_counters after = counters_of(connected.node.get());
  EXPECT_LT(after.write_calls - before.write_calls, 20u);
}

TEST(Nif, StampsAnAgeInTheHubsTime) {
  for (const std::int64_t ahead_ns :
       {std::int64_t{5'000'000'000}, std::int64_t{-3'600'000'000'000}}) {
    FakeHub hub;
    proto::Welcome welcome = make_welcome();
    const std::int64_t before_ns = welcome.hub_time_ns = wall_now_ns() + ahead_ns;
    Connected connected = connect_to(hub, default_options(), welcome);
    nif_outgoing message = NIF_OUTGOING_INIT;
    message.to = kPeerId;
    message.age_ms_max = 100;
    ASSERT_EQ(nif_send(connected.node.get(), &message, NIF_FOREVER), NIF_OK);
    const auto frame = connected.hub.next_message();
    ASSERT_TRUE(frame);
    const auto age = proto::find_age(frame->view().extensions);
    ASSERT_TRUE(age);
    EXPECT_GE(age->origin_ns, before_ns) << ahead_ns;
    EXPECT_LE(age->origin_ns, wall_now_ns() + ahead_ns) << ahead_ns;
  }
}

TEST(Nif, RefusesUnsoundMessages) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_outgoing message = NIF_OUTGOING_INIT;
  EXPECT_EQ(nif_send(connected.node.get(), nullptr, 0), NIF_BAD_ARGUMENT);
  message.struct_size = 3;
  EXPECT_EQ(nif_send(connected.node.get(), &message, 0), NIF_BAD_ARGUMENT);
  EXPECT_NE(std::string(nif_error_text()), "");
}

TEST(Nif, AnswersForHandlesThatAreNone) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_node* const stale = connected.node.get();
  EXPECT_EQ(nif_close(connected.node.release()), NIF_OK);
  nif_incoming in;
  EXPECT_EQ(nif_close(stale), NIF_CLOSED);
  EXPECT_EQ(nif_send_to(stale, kPeerId, "", 0), NIF_CLOSED);
  EXPECT_EQ(nif_receive(stale, &in, 0), NIF_CLOSED);
  EXPECT_EQ(nif_id(stale), 0u);
  EXPECT_EQ(nif_event_fd(stale), -1);
  EXPECT_EQ(nif_close(nullptr), NIF_CLOSED);
  EXPECT_EQ(nif_flush(reinterpret_cast<nif_node*>(0x1234)), NIF_CLOSED);
  EXPECT_EQ(nif_connect(nullptr, nullptr), NIF_BAD_ARGUMENT);
  nif_release(nullptr);
}

TEST(Nif, EventDescriptorIsReadableWhileSomethingWaits) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  pollfd wait{nif_event_fd(connected.node.get()), POLLIN, 0};
  ASSERT_GE(wait.fd, 0);
  EXPECT_EQ(::poll(&wait, 1, 0), 0);
  connected.hub.send_unicast(kPeerId, kOwnId, "a");
  ASSERT_EQ(::poll(&wait, 1, 20'000), 1);
  nif_incoming in;
  ASSERT_EQ(nif_receive(connected.node.get(), &in, 0), NIF_OK);
  nif_release(&in);
  EXPECT_EQ(::poll(&wait, 1, 0), 0);
  EXPECT_EQ(nif_receive(connected.node.get(), &in, 0), NIF_TIMEOUT);
}

TEST(Nif, ManyThreadsSendAndReceiveOnOneHandle) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  constexpr int kThreads = 4;
  constexpr int kMessages = 500;
  std::atomic<int> received{0};
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < kMessages; ++i) {
        const std::string text = std::to_string(t) + ":" + std::to_string(i);
        ASSERT_EQ(nif_send_to(connected.node.get(), kPeerId, text.data(), text.size()), NIF_OK);
      }
    });
    threads.emplace_back([&] {
      nif_incoming in;
      while (received.load() < kThreads * kMessages) {
        if (nif_receive(connected.node.get(), &in, 20) != NIF_OK) continue;
        received.fetch_add(1);
        nif_release(&in);
      }
    });
  }
  std::vector<int> next(kThreads, 0);
  for (int i = 0; i < kThreads * kMessages; ++i) {
    const auto frame = connected.hub.next_message();
    ASSERT_TRUE(frame);
    const std::string text = frame->payload();
    const auto thread = static_cast<std::size_t>(text[0] - '0');
    EXPECT_EQ(text, std::to_string(thread) + ":" + std::to_string(next[thread]++))
        << "order within a thread";
    connected.hub.send_unicast(kPeerId, kOwnId, text);
  }
  for (auto& thread : threads) thread.join();
  EXPECT_EQ(received.load(), kThreads * kMessages);
}

TEST(Nif, CloseEndsCallsThatWait) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_node* const node = connected.node.get();
  std::thread receiving([node] {
    nif_incoming in;
    EXPECT_EQ(nif_receive(node, &in, NIF_FOREVER), NIF_CLOSED);
  });
  std::thread asking([node] {
    std::uint32_t id = 0;
    EXPECT_EQ(nif_resolve(node, "nobody", &id, NIF_FOREVER), NIF_CLOSED);
  });
  const auto request = connected.hub.next_message();
  EXPECT_TRUE(request);
  EXPECT_EQ(nif_close(connected.node.release()), NIF_OK);
  receiving.join();
  asking.join();
}

struct CallbackState {
  nif_node* node = nullptr;
  std::atomic<int> calls{0};
  std::atomic<bool> full{true};
  std::atomic<int> taken{0};
};

nif_verdict on_incoming(void* user, const nif_incoming* in) {
  auto* const state = static_cast<CallbackState*>(user);
  state->calls.fetch_add(1);
  if (in->type != NIF_MESSAGE) return NIF_DONE;
  if (state->full.load()) return NIF_NOT_NOW;
  if (payload_of(*in) == "close") {
    EXPECT_EQ(nif_close(state->node), NIF_IN_CALLBACK);
  }
  std::uint32_t id = 0;
  EXPECT_EQ(nif_resolve(state->node, "x", &id, 0), NIF_IN_CALLBACK);
  state->taken.fetch_add(1);
  EXPECT_EQ(nif_send_to(state->node, kPeerId, "answer", 6), NIF_OK);
  return NIF_DONE;
}

TEST(Nif, CallbackMayRefuseAndIsCalledAgain) {
  FakeHub hub;
  CallbackState state;
  nif_options options = default_options();
  options.callback = on_incoming;
  options.user = &state;
  Connected connected = connect_to(hub, options, make_welcome());
  state.node = connected.node.get();
  nif_incoming in;
  EXPECT_EQ(nif_receive(state.node, &in, 0), NIF_BAD_ARGUMENT);
  connected.hub.send_unicast(kPeerId, kOwnId, "one");
  while (state.calls.load() == 0) std::this_thread::yield();
  EXPECT_EQ(state.taken.load(), 0);
  state.full.store(false);
  EXPECT_EQ(nif_deliver(state.node), NIF_OK);
  connected.hub.send_unicast(kPeerId, kOwnId, "close");
  for (int i = 0; i < 2; ++i) {
    const auto frame = connected.hub.next_message();
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->payload(), "answer");
  }
  EXPECT_EQ(state.taken.load(), 2);
}

struct HesitantState {
  std::atomic<std::uint32_t> taken{0};
  std::uint32_t refused = 0;  ///< the library's thread
};

/// Has no room for every 10th message when it is asked for the first time.
nif_verdict hesitate(void* user, const nif_incoming* in) {
  auto* const state = static_cast<HesitantState*>(user);
  if (in->type != NIF_MESSAGE) return NIF_DONE;
  const std::uint32_t next = state->taken.load();
  EXPECT_EQ(payload_of(*in), std::to_string(next)) << "nothing overtakes what was refused";
  if (next % 10 == 9 && state->refused != next) {
    state->refused = next;
    return NIF_NOT_NOW;
  }
  state->taken.fetch_add(1);
  return NIF_DONE;
}

TEST(Nif, WhatACallbackRefusesStaysInOrder) {
  constexpr std::uint32_t kMessages = 500;
  FakeHub hub;
  HesitantState state;
  nif_options options = default_options();
  options.callback = hesitate;
  options.user = &state;
  Connected connected = connect_to(hub, options, make_welcome());
  for (std::uint32_t i = 0; i < kMessages; ++i)
    connected.hub.send_unicast(kPeerId, kOwnId, std::to_string(i));
  while (state.taken.load() < kMessages) {
    EXPECT_EQ(nif_deliver(connected.node.get()), NIF_OK);
    std::this_thread::yield();
  }
}

TEST(Nif, TheEndOfABurstIsWrittenWithoutAFurtherCall) {
  constexpr int kBursts = 40;
  FakeHub hub;
  proto::Welcome welcome = make_welcome();
  welcome.keep_alive_ms = 600'000;  // or what is forgotten would go with the next PING
  Connected connected = connect_to(hub, default_options(), welcome);
  int next = 0;
  for (int burst = 1; burst <= kBursts; ++burst) {
    // Of all lengths, so that some end while the library's thread writes.
    const int count = 97 * burst;
    for (int i = 0; i < count; ++i) {
      const std::string text = std::to_string(next + i);
      ASSERT_EQ(nif_send_to(connected.node.get(), kPeerId, text.data(), text.size()), NIF_OK);
    }
    for (const int end = next + count; next < end; ++next) {
      const auto frame = connected.hub.next_message();
      ASSERT_TRUE(frame) << next;
      ASSERT_EQ(frame->payload(), std::to_string(next));
    }
  }
}

}  // namespace
}  // namespace gimnet::nif::test
