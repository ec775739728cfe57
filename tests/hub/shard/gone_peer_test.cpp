#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/sockios.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "net/socket_stream.hpp"
#include "tests/hub/shard/support/hub_rig.hpp"
#include "tests/net/support/connected_sockets.hpp"

// A peer that is gone, behind a real socket: what it had sent is with the kernel, writing to it
// fails, and the kernel tells of its end whether it is asked or not. Time is the rig's.

namespace gimnet::hub {
namespace {

using Family = net::SocketStream::Family;

constexpr net::SocketOptions kSizes{.send_bytes = 256 * 1'024};
using testing::FakeNode;
using testing::HubRig;
using ::testing::SizeIs;

constexpr std::size_t kFrameBytes = 1024;

Limits small_limits() {
  Limits limits;
  limits.lane1_bytes = 64 * 1024;
  limits.reserve_bytes = 32 * 1024;
  limits.turn_bytes = 4 * 1024;
  return limits;
}

class GonePeer : public ::testing::TestWithParam<Family> {
 protected:
  ~GonePeer() override { leave(); }

  /// The node behind the socket joins.
  void join(bool resume = false) {
    const auto [near, far] = connect_by(GetParam());
    far_ = far;
    near_ = near;
    AttachCommand command;
    command.session = {ConnectionSlot{500}, 77};
    command.attachment = 1;
    command.node = sender_.id = make_id<NodeId>(rig_.hub(), 500);
    command.transport = std::make_unique<net::SocketStream>(near, GetParam(), kSizes);
    command.welcome.node = sender_.id;
    command.resume_wanted = resume;
    command.peer_epoch = 5;
    command.peer_resume_bytes = 1 << 20;
    command.peer_frame_bytes = proto::kFrameLengthDefault;
    rig_.command(0, std::move(command));
    rig_.nodes().publish(500, {ShardIndex{0}, ConnectionSlot{500}, 77});
    turn();
  }
  void write(std::span<const std::byte> bytes) {
    ASSERT_EQ(::send(far_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT),
              static_cast<ssize_t>(bytes.size()));
  }
  void send(const FakeNode& to) {
    const std::string payload(kFrameBytes - proto::kHeaderSize, 'x');
    write(HubRig::frame(sender_, to.id.value(), payload));
    ++sent_;
  }
  void say_goodbye() {
    const auto goodbye = proto::encode(proto::Goodbye{proto::GoodbyeCode::done, ""});
    const std::string payload(reinterpret_cast<const char*>(goodbye.data()), goodbye.size());
    write(HubRig::frame(sender_, 0, payload, {.kind = proto::Kind::link, .lane = 0}));
  }
  void send_pong() {
    std::byte frame[proto::flow::kFrameSizeMax];
    const std::size_t size = proto::flow::encode_frame(proto::flow::Pong{}, NodeId{}, frame);
    write({frame, size});
  }
  /// All that it sent is with the hub's kernel.
  void arrive() {
    if (GetParam() != Family::tcp) return;
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds{60};
    for (int unacknowledged = 1; unacknowledged != 0;) {
      ASSERT_EQ(::ioctl(far_, SIOCOUTQ, &unacknowledged), 0);
      ASSERT_LT(std::chrono::steady_clock::now(), deadline);
      std::this_thread::yield();
    }
  }
  void leave() {
    if (far_ >= 0) ::close(std::exchange(far_, -1));
  }
  /// Its process is gone, and the hub's kernel knows.
  void vanish() {
    arrive();
    leave();
    pollfd end{near_, 0, 0};
    ASSERT_EQ(::poll(&end, 1, 60'000), 1);
  }
  /// A turn with what the poller tells, and what is to be told of those that no poller knows.
  void turn() {
    std::vector<Ready> ready = rig_.ready(0);
    for (const Ready& each : rig_.state(0).poller.wait(0)) {
      ready.push_back(each);
      ++told_;
    }
    rig_.shard(0).turn(ready, rig_.now_ms);
  }
  void turns(int count) {
    for (int i = 0; i < count; ++i) turn();
  }
  /// Sends until it is read no more, and a little beyond.
  void fill(FakeNode& to) {
    for (int i = 0; i < 1'000 && rig_.sum(&ShardCounters::held_reads) == 0; ++i) {
      send(to);
      turn();
    }
    ASSERT_EQ(rig_.sum(&ShardCounters::held_reads), 1u);
    for (int i = 0; i < 16; ++i) send(to);
  }
  /// The same, so that it is read no more in the middle of a frame; what it sends last is half a
  /// frame, too.
  void fill_in_the_middle(FakeNode& to) {
    std::vector<std::byte> bytes =
        HubRig::frame(sender_, to.id.value(), std::string(kFrameBytes - proto::kHeaderSize, 'x'));
    const auto half = static_cast<std::ptrdiff_t>(kFrameBytes / 2);
    write(std::span(bytes).first(kFrameBytes / 2));
    std::rotate(bytes.begin(), bytes.begin() + half, bytes.end());
    const auto send_two_halves = [&] {
      write(bytes);
      ++sent_;
    };
    for (int i = 0; i < 1'000 && rig_.sum(&ShardCounters::held_reads) == 0; ++i) {
      send_two_halves();
      turn();
    }
    ASSERT_EQ(rig_.sum(&ShardCounters::held_reads), 1u);
    ASSERT_FALSE(rig_.state(0).find(sender_.id)->tail.empty());
    for (int i = 0; i < 16; ++i) send_two_halves();
  }
  /// Everybody reads until nothing comes any more.
  void deliver(FakeNode& to) {
    to.pipe.set_room(MemoryPeer::kAll);
    for (int quiet = 0; quiet < 10;) {
      turn();
      quiet = to.pipe.readable() == 0 ? quiet + 1 : 0;
      to.read();
    }
    EXPECT_TRUE(rig_.ledger().exact());
  }
  std::optional<DetachedEvent> end() { return rig_.take_detached(); }

  const Limits limits_ = small_limits();
  HubRig rig_{1, limits_};
  FakeNode sender_;
  int near_ = -1;
  int far_ = -1;
  std::size_t sent_ = 0;
  std::size_t told_ = 0;  ///< events of the poller
};

INSTANTIATE_TEST_SUITE_P(Families, GonePeer, ::testing::Values(Family::unix_socket, Family::tcp));

TEST_P(GonePeer, KeepsNoShardAwakeWhileItIsHeld) {
  FakeNode& to = rig_.join(0);
  join();
  to.pipe.set_room(0);
  fill(to);
  vanish();
  told_ = 0;
  turns(100);
  EXPECT_LE(told_, 1u);
  rig_.now_ms += 1'100;  // PING is due, and cannot be written
  turns(100);
  EXPECT_LE(told_, 2u);
}

TEST_P(GonePeer, WhatItSentBeforeIsDeliveredWhenItIsReadAgain) {
  FakeNode& to = rig_.join(0);
  join();
  to.pipe.set_room(0);
  fill(to);
  say_goodbye();
  vanish();
  for (int ms = 0; ms < 4'000; ms += 500) {
    rig_.now_ms += 500;
    rig_.send_flow(to, proto::flow::Pong{});
    turn();
  }
  EXPECT_FALSE(end()) << "PINGs could not be written";
  deliver(to);
  EXPECT_THAT(to.frames, SizeIs(sent_));
  const auto ended = end();
  ASSERT_TRUE(ended);
  EXPECT_TRUE(ended->said_by_peer) << "its GOODBYE stood behind them";
}

TEST_P(GonePeer, IsNoSlowConsumerWhileItIsHeld) {
  FakeNode& to = rig_.join(0);
  FakeNode& other = rig_.join(0);
  join(true);
  to.pipe.set_room(kFrameBytes);
  fill(to);
  vanish();
  rig_.send(other, sender_.id.value(), "waits for its return");
  for (int ms = 0; ms < 15'000; ms += 500) {
    rig_.now_ms += 500;
    rig_.send_flow(to, proto::flow::Pong{});
    rig_.send_flow(other, proto::flow::Pong{});
    to.read(kFrameBytes / 2);
    turn();
  }
  EXPECT_FALSE(end());
  deliver(to);
  EXPECT_THAT(to.frames, SizeIs(sent_));
  EXPECT_TRUE(end());
  EXPECT_EQ(rig_.ledger().dropped, 0u);
  EXPECT_EQ(rig_.ledger().queued, 1u);
}

TEST_P(GonePeer, IsNotHeldForEverByWhatWaitsForItself) {
  FakeNode& other = rig_.join(0);
  join(true);
  fill(sender_);
  vanish();
  rig_.send(other, sender_.id.value(), "writing to it fails");
  const std::uint64_t heard_ms = rig_.now_ms;
  bool ended = false;
  while (!ended && rig_.now_ms < heard_ms + 2 * limits_.grace_ms) {
    rig_.now_ms += 500;
    rig_.send_flow(other, proto::flow::Pong{});
    turn();
    ended = end().has_value();
  }
  EXPECT_TRUE(ended);
  EXPECT_GE(rig_.now_ms, heard_ms + limits_.grace_ms);
}

TEST_P(GonePeer, WhatItSentIsReadAlthoughWritingToItFails) {
  FakeNode& to = rig_.join(0);
  FakeNode& other = rig_.join(0);
  join();
  for (int i = 0; i < 64; ++i) send(to);
  say_goodbye();
  vanish();
  rig_.send(other, sender_.id.value(), "too late");
  deliver(to);
  EXPECT_THAT(to.frames, SizeIs(sent_));
  const auto ended = end();
  ASSERT_TRUE(ended);
  EXPECT_TRUE(ended->said_by_peer);
  EXPECT_EQ(rig_.dropped(proto::DropReason::link_lost), 1u);
}

TEST_P(GonePeer, BreaksWhereItDidNotSayGoodbye) {
  join();
  vanish();
  rig_.now_ms += 1'100;
  turns(3);
  const auto ended = end();
  ASSERT_TRUE(ended);
  EXPECT_FALSE(ended->said_by_peer);
  EXPECT_EQ(rig_.sum(&ShardCounters::connections), 0u);
}

TEST_P(GonePeer, DelaysNoDrain) {
  FakeNode& to = rig_.join(0);
  join();
  to.pipe.set_room(0);
  fill(to);
  vanish();
  rig_.now_ms += 1'100;
  turn();  // PING cannot be written
  rig_.command(0, DrainCommand{60'000});
  deliver(to);
  EXPECT_EQ(rig_.sum(&ShardCounters::connections), 0u);
}

TEST_P(GonePeer, BrokeItsFrameWhereItIsReadToTheEnd) {
  FakeNode& to = rig_.join(0);
  join();
  to.pipe.set_room(0);
  fill_in_the_middle(to);
  vanish();
  deliver(to);
  EXPECT_THAT(to.frames, SizeIs(sent_));
  EXPECT_EQ(rig_.sum(&ShardCounters::connections), 1u);
  EXPECT_EQ(rig_.sum(&ShardCounters::unfinished_frames), 1u);
}

TEST_P(GonePeer, BrokeNoFrameWhereTheHubEndsInTheMiddleOfOne) {
  FakeNode& to = rig_.join(0);
  join();
  to.pipe.set_room(0);
  fill_in_the_middle(to);
  vanish();
  rig_.now_ms += 1'100;
  turn();  // PING cannot be written
  ASSERT_EQ(rig_.state(0).find(sender_.id)->write, WriteState::failed);
  rig_.command(0, DrainCommand{60'000});
  deliver(to);
  EXPECT_EQ(rig_.sum(&ShardCounters::connections), 0u);
  EXPECT_EQ(rig_.sum(&ShardCounters::unfinished_frames), 0u);
}

TEST_P(GonePeer, BrokeNoFrameWhereItsTimeIsOverInTheMiddleOfOne) {
  FakeNode& other = rig_.join(0);
  join(true);
  fill_in_the_middle(sender_);
  vanish();
  for (std::uint64_t ms = 0; ms < 2 * limits_.grace_ms; ms += 500) {
    rig_.now_ms += 500;
    rig_.send_flow(other, proto::flow::Pong{});
    turn();
  }
  EXPECT_TRUE(end());
  EXPECT_EQ(rig_.sum(&ShardCounters::unfinished_frames), 0u);
}

/// Only a Unix socket tells that its far end takes nothing any more and goes on sending: TCP has no
/// word for it.
class GoneUnixPeer : public GonePeer {};
INSTANTIATE_TEST_SUITE_P(Unix, GoneUnixPeer, ::testing::Values(Family::unix_socket));

TEST_P(GoneUnixPeer, WhoTakesNothingAndGoesOnSendingIsNotKept) {
  join();
  ASSERT_EQ(::shutdown(far_, SHUT_RD), 0);
  for (int ms = 0; ms < 3'900; ms += 100) {
    rig_.now_ms += 100;
    send_pong();
    turn();
  }
  EXPECT_EQ(rig_.sum(&ShardCounters::connections), 1u) << "from the first PING on";
  rig_.now_ms += 300;
  turn();
  EXPECT_EQ(rig_.sum(&ShardCounters::connections), 0u);
  EXPECT_EQ(rig_.sum(&ShardCounters::silent), 0u);
}

}  // namespace
}  // namespace gimnet::hub
