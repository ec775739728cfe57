#include "tests/support/system_calls.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <chrono>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "net/socket_stream.hpp"
#include "tests/hub/shard/support/hub_rig.hpp"
#include "tests/net/support/connected_sockets.hpp"

// The price of a shard's turn in system calls, as the kernel counts them: one wait, one read of a
// connection that has something, one write of each that gets something, whatever the number of
// frames. Instructions, which perf/instructions counts, do not show what the kernel does. None of
// this depends on how fast anything is.

namespace gimnet::hub {
namespace {

using Calls = std::vector<int>;
using Family = net::SocketStream::Family;

constexpr net::SocketOptions kSizes{.send_bytes = 256 * 1'024};
using ::testing::ElementsAre;
using testing::FakeNode;
using testing::HubRig;

/// A shard and nodes behind sockets. All but the sockets' far ends belongs to the thread whose
/// calls are counted.
class TurnSystemCalls : public ::testing::TestWithParam<Family> {
 protected:
  ~TurnSystemCalls() override {
    for (const int descriptor : far_) ::close(descriptor);
  }

  void join(std::uint32_t count) {
    for (std::uint32_t i = 0; i < count; ++i) {
      const auto [near, far] = connect_by(GetParam());
      far_.push_back(far);
      near_.push_back(near);
      FakeNode node;
      const std::uint32_t index = kFirst + i;
      node.session = {ConnectionSlot{index}, index};
      node.shard = ShardIndex{0};
      AttachCommand command;
      command.session = node.session;
      command.attachment = 1;
      command.node = node.id = command.welcome.node = make_id<NodeId>(rig_.hub(), index);
      command.transport = std::make_unique<net::SocketStream>(near, GetParam(), kSizes);
      command.peer_epoch = 5;
      command.peer_frame_bytes = proto::kFrameLengthDefault;
      rig_.command(0, std::move(command));
      rig_.nodes().publish(index, {ShardIndex{0}, ConnectionSlot{index}, index});
      nodes_.push_back(std::move(node));
    }
    turn();
  }

  /// The first node sends; all of it is with the hub's kernel.
  void send(const std::vector<std::byte>& bytes) {
    ASSERT_EQ(::send(far_.front(), bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT),
              static_cast<ssize_t>(bytes.size()));
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds{60};
    for (int arrived = 0; arrived != static_cast<int>(bytes.size());) {
      ASSERT_EQ(::ioctl(near_.front(), FIONREAD, &arrived), 0);
      ASSERT_LT(std::chrono::steady_clock::now(), deadline);
      std::this_thread::yield();
    }
  }

  /// Frames to as many of the others, in turns.
  [[nodiscard]] std::vector<std::byte> frames_to(std::uint32_t recipients,
                                                 std::uint32_t count) const {
    std::vector<std::byte> bytes;
    for (std::uint32_t i = 0; i < count; ++i) {
      const auto frame = HubRig::frame(nodes_.front(), nodes_[1 + i % recipients].id.value(),
                                       std::string("sixteen bytes!!!"));
      bytes.insert(bytes.end(), frame.begin(), frame.end());
    }
    return bytes;
  }

  /// As the shard's thread does it.
  void turn() { rig_.shard(0).turn(rig_.state(0).poller.wait(0), rig_.now_ms); }

  [[nodiscard]] std::optional<Calls> calls_of_turn(const std::function<void()>& before) {
    return gimnet::test::system_calls_of(before, [this] {
      turn();
      rig_.state(0).egress.owner.let_go();  // the test's thread clears up
    });
  }
  [[nodiscard]] std::uint64_t delivered() const { return rig_.ledger().delivered; }

  static constexpr std::uint32_t kFirst = 500;
  HubRig rig_;
  std::deque<FakeNode> nodes_;
  std::vector<int> near_;
  std::vector<int> far_;
};

INSTANTIATE_TEST_SUITE_P(Families, TurnSystemCalls,
                         ::testing::Values(Family::unix_socket, Family::tcp));

/// GTEST_SKIP() leaves the function that it stands in.
#define GIMNET_COUNT_OR_SKIP(calls, before)                                                \
  const std::optional<Calls> calls##_told = calls_of_turn(before);                         \
  if (!(calls##_told)) GTEST_SKIP() << "this kernel does not tell system calls (seccomp)"; \
  const Calls& calls = *(calls##_told)

Calls with_sends(std::size_t count, int call = SYS_sendto) {
  Calls calls{SYS_epoll_wait, SYS_recvfrom};
  calls.insert(calls.end(), count, call);
  return calls;
}

TEST_P(TurnSystemCalls, OnlyTheWaitWhereNothingHappens) {
  GIMNET_COUNT_OR_SKIP(calls, [this] { join(2); });
  EXPECT_THAT(calls, ElementsAre(SYS_epoll_wait));
}

TEST_P(TurnSystemCalls, ThreeForAFrame) {
  GIMNET_COUNT_OR_SKIP(calls, [this] {
    join(2);
    send(frames_to(1, 1));
  });
  EXPECT_THAT(calls, ElementsAre(SYS_epoll_wait, SYS_recvfrom, SYS_sendto));
  EXPECT_EQ(delivered(), 1u);
}

TEST_P(TurnSystemCalls, ThreeForAThousandFramesToOne) {
  GIMNET_COUNT_OR_SKIP(calls, [this] {
    join(2);
    send(frames_to(1, 1'000));
  });
  EXPECT_EQ(calls, with_sends(1));
  EXPECT_EQ(delivered(), 1'000u);
}

TEST_P(TurnSystemCalls, OneWriteForEachThatGetsFramesInTurns) {
  GIMNET_COUNT_OR_SKIP(calls, [this] {
    join(9);
    send(frames_to(8, 1'000));
  });
  EXPECT_EQ(calls, with_sends(8, SYS_sendmsg)) << "each with several pieces of the read";
  EXPECT_EQ(delivered(), 1'000u);
}

TEST_P(TurnSystemCalls, OneWriteForEachMemberOfAGroup) {
  constexpr std::uint32_t kMembers = 100;
  constexpr std::uint32_t kFrames = 10;
  GIMNET_COUNT_OR_SKIP(calls, [this] {
    join(1 + kMembers);
    std::vector<FakeNode*> members;
    for (std::size_t i = 1; i < nodes_.size(); ++i) members.push_back(&nodes_[i]);
    rig_.publish_group(1, nodes_.front().id, members);
    std::vector<std::byte> bytes;
    for (std::uint32_t i = 0; i < kFrames; ++i) {
      const auto frame =
          HubRig::frame(nodes_.front(), HubRig::group(1), "to all", {.kind = proto::Kind::group});
      bytes.insert(bytes.end(), frame.begin(), frame.end());
    }
    send(bytes);
  });
  EXPECT_EQ(calls, with_sends(kMembers));
  EXPECT_EQ(delivered(), std::uint64_t{kMembers} * kFrames);
}

}  // namespace
}  // namespace gimnet::hub
