#include "client/nif/handles.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <string>
#include <thread>
#include <vector>

#include "tests/client/nif/support/every_call.hpp"
#include "tests/client/nif/support/fake_hub.hpp"

namespace gimnet::nif::test {
namespace {

TEST(Handles, AClosedHandleNeverComesBack) {
  FakeHub hub;
  nif_node* former = nullptr;
  for (int i = 0; i < 5; ++i) {
    Connected connected = connect_to(hub, default_options(), make_welcome());
    EXPECT_NE(connected.node.get(), former);
    EXPECT_EQ(nif_flush(former), NIF_CLOSED);
    former = connected.node.get();
    EXPECT_TRUE(find_node(former));
    connected.hub.close();
  }
}

TEST(Handles, RefusesWhatIsNoHandle) {
  for (const std::uintptr_t value :
       {std::uintptr_t{0}, std::uintptr_t{8}, std::uintptr_t{16}, ~std::uintptr_t{0}}) {
    const NodeRef node = find_node(reinterpret_cast<const nif_node*>(value));
    EXPECT_FALSE(node);
    EXPECT_EQ(node.status(), NIF_CLOSED);
  }
}

TEST(Handles, AChildIsToldThatTheHandleIsItsParents) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_node* const node = connected.node.get();
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    const bool right = nif_send_to(node, kPeerId, "", 0) == NIF_FORKED &&
                       nif_close(node) == NIF_OK && nif_close(node) == NIF_CLOSED;
    ::_exit(right ? 0 : 1);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
  EXPECT_EQ(nif_send_to(node, kPeerId, "", 0), NIF_OK) << "the parent goes on";
  const auto frame = connected.hub.next_message();
  ASSERT_TRUE(frame) << "the connection stands";
  EXPECT_EQ(frame->header.kind, proto::Kind::unicast) << "the child said nothing to the hub";
}

// Also one that would wait for ever.
TEST(Handles, ACallOfAChildThatWaitsIsRefused) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options("robot"), make_welcome(1u << 20));
  nif_node* const node = connected.node.get();
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    ::alarm(20);  // where it hangs
    nif_incoming in{};
    std::uint32_t id = 0;
    nif_outgoing message = NIF_OUTGOING_INIT;
    message.to = kPeerId;
    const bool right = nif_receive(node, &in, NIF_FOREVER) == NIF_FORKED &&
                       nif_send(node, &message, NIF_FOREVER) == NIF_FORKED &&
                       nif_drain(node, NIF_FOREVER) == NIF_FORKED &&
                       nif_resolve(node, "other", &id, NIF_FOREVER) == NIF_FORKED &&
                       nif_ping_hub(node, nullptr, nullptr, NIF_FOREVER) == NIF_FORKED;
    ::_exit(right ? 0 : 1);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
}

TEST(Handles, EveryCallRefusesWhatIsNoHandle) {
  FakeHub hub;
  nif_node* closed = nullptr;
  {
    Connected connected = connect_to(hub, default_options(), make_welcome());
    closed = connected.node.get();
    connected.hub.close();
  }
  for (nif_node* const node :
       {static_cast<nif_node*>(nullptr), closed, reinterpret_cast<nif_node*>(0x1234)}) {
    for (const Call& call : kCalls) {
      EXPECT_EQ(call.sound(node), NIF_CLOSED) << call.name;
      if (call.unsound != nullptr) {
        EXPECT_EQ(call.unsound(node), NIF_CLOSED) << call.name;
      }
    }
    EXPECT_EQ(nif_last_error(node, nullptr, 0), 0u);
    EXPECT_EQ(nif_close(node), NIF_CLOSED);
  }
}

TEST(Handles, EveryCallRefusesNothingInPlaceOfItsArguments) {
  FakeHub hub;
  const Connected connected = connect_to(hub, default_options(), make_welcome());
  for (const Call& call : kCalls) {
    if (call.unsound == nullptr) continue;
    EXPECT_EQ(call.unsound(connected.node.get()), NIF_BAD_ARGUMENT) << call.name;
    EXPECT_NE(std::string(nif_error_text()), "") << call.name;
  }
  EXPECT_EQ(nif_last_error(connected.node.get(), nullptr, 0), 0u);
  nif_free_nodes(nullptr);
  nif_free_services(nullptr);
  nif_free_reply(nullptr);
  nif_release(nullptr);
}

TEST(Handles, EveryCallOfAChildIsRefused) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_node* const node = connected.node.get();
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    int wrong = 0;
    for (const Call& call : kCalls) {
      const nif_status status = call.sound(node);
      const bool says_so = call.name == "nif_id" || call.name == "nif_event_fd"
                               ? status == NIF_CLOSED
                               : status == NIF_FORKED;
      wrong += says_so ? 0 : 1;
    }
    ::_exit(wrong);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
}

/// The results that a callback saw when it called everything.
struct Reentrant {
  nif_node* node = nullptr;
  std::atomic<bool> ready{false};
  std::atomic<bool> done{false};
  std::vector<std::string> wrong;
};

nif_verdict call_everything(void* user, const nif_incoming* in) {
  auto* const state = static_cast<Reentrant*>(user);
  if (in->type != NIF_MESSAGE) return NIF_DONE;
  while (!state->ready.load()) std::this_thread::yield();
  for (const Call& call : kCalls) {
    const nif_status status = call.sound(state->node);
    const bool right =
        call.waits ? status == NIF_IN_CALLBACK : status != NIF_IN_CALLBACK && status != NIF_CLOSED;
    if (!right) state->wrong.emplace_back(call.name);
  }
  if (nif_close(state->node) != NIF_IN_CALLBACK) state->wrong.emplace_back("nif_close");
  state->done.store(true);
  return NIF_DONE;
}

TEST(Handles, InTheCallbackWhatWaitsForTheHubIsRefusedAndTheRestWorks) {
  FakeHub hub;
  Reentrant state;
  nif_options options = default_options();
  options.callback = call_everything;
  options.user = &state;
  Connected connected = connect_to(hub, options, make_welcome());
  state.node = connected.node.get();
  state.ready.store(true);
  connected.hub.send_unicast(kPeerId, kOwnId, "now");
  while (!state.done.load()) std::this_thread::yield();
  EXPECT_EQ(state.wrong, std::vector<std::string>{});
}

TEST(Handles, OfManyThreadsThatCloseOneHandleOneClosesIt) {
  for (int round = 0; round < 20; ++round) {
    FakeHub hub;
    Connected connected = connect_to(hub, default_options(), make_welcome());
    nif_node* const node = connected.node.release();
    connected.hub.close();
    std::atomic<int> closed{0};
    std::vector<std::thread> threads;
    for (int i = 0; i < 4; ++i) {
      threads.emplace_back([&] {
        const nif_status status = nif_close(node);
        EXPECT_TRUE(status == NIF_OK || status == NIF_CLOSED);
        closed += status == NIF_OK ? 1 : 0;
      });
      threads.emplace_back([&] {
        while (nif_id(node) != 0) {
          for (const Call& call : kCalls) static_cast<void>(call.sound(node));
        }
      });
    }
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(closed, 1);
  }
}

}  // namespace
}  // namespace gimnet::nif::test
