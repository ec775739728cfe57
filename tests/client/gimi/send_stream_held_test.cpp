#include <gtest/gtest.h>

#include <atomic>
#include <cstddef>
#include <thread>
#include <vector>

#include "base/clock.hpp"
#include "client/gimi/send_stream.hpp"
#include "tests/client/gimi/support/conversation.hpp"

// Messages that are held: the latest waits for room in the window, or for its way.

namespace gimnet::gimi {
namespace {

using test::Conversation;
using test::kAll;
using test::kKey;
using test::kPeerId;
using test::MessageOperation;

/// Two threads on one stream: a message comes to be held while another is still on its way to the
/// network, because the hub paused its destination.
class HeldBehindAnother : public Conversation {
 protected:
  static constexpr proto::flow::Target kTarget{proto::Kind::unicast, proto::Lane::normal, kPeerId};

  HeldBehindAnother() : stream_(sender(1, AtFullWindow::hold_latest)) {
    // The first message tells the epoch of the stream, which acknowledgements have to name.
    stream_.send("0").or_throw();
    EXPECT_EQ(next_data().data, "0");
    acknowledge(1);
    stream_.settle().or_throw();
    hub_.send(proto::flow::Pause{kTarget});
    settle_down();
  }

  /// Returns when the node has handled everything that the hub said before.
  void settle_down() {
    const std::string text = "x";
    answer({++sequence_, MessageOperation::data, 0, 0}, std::as_bytes(std::span(text)));
    EXPECT_EQ(node_->receive(kKey, kForever)->sequence(), sequence_);
  }

  Sender stream_;
  std::uint32_t sequence_ = 0;
};

TEST_F(HeldBehindAnother, GoesWhenTheAckOvertakesTheEndOfSending) {
  std::thread sending([&] { stream_.send("1").or_throw(); });
  while (stream_.counts().waiting != 1) std::this_thread::yield();
  stream_.send("2").or_throw();
  EXPECT_EQ(stream_.counts().waiting, 2u);
  acknowledge(2);
  settle_down();
  EXPECT_EQ(stream_.counts().acknowledged, 2u);
  hub_.send(proto::flow::Resume{kTarget});
  EXPECT_EQ(next_data().data, "1");
  sending.join();
  ASSERT_EQ(next_data().data, "2");
  acknowledge(3);
  EXPECT_TRUE(stream_.settle());
}

TEST_F(HeldBehindAnother, GoesWhenTheOtherCannotBeSent) {
  bool held = false;
  // If this thread is so late that the other one gave up before, nothing is held, and it tries once
  // more.
  for (Timeout patience{100}; !held; patience *= 2) {
    std::atomic<bool> over = false;
    std::thread sending([&] {
      EXPECT_TRUE(stream_.send("1", patience).is(Status::timeout));
      over = true;
    });
    while (stream_.counts().waiting != 1 && !over) std::this_thread::yield();
    held = stream_.send("2", kNoWait).ok();
    sending.join();
  }
  EXPECT_EQ(stream_.counts().sent, 1u);
  hub_.send(proto::flow::Resume{kTarget});
  ASSERT_EQ(next_data().data, "2");
  acknowledge(2);
  EXPECT_TRUE(stream_.settle());
}

/// While its way is paused it is tried again and again: at no moment has it gone, and a newer one
/// cannot come before it.
TEST(SendStream, AMessageThatIsHeldIsHeldWhileItIsTried) {
  struct Keeper final : StreamKeeper {
    void watch(SendStream& /*stream*/) override {}
  } keeper;
  test::FakeHub hub;
  nif::test::Connected connected =
      nif::test::connect_to(hub, nif::test::default_options(), nif::test::make_welcome());
  Uplink uplink;
  uplink.open(connected.node.get());
  SendOptions options;
  options.window = 1;
  options.at_full = AtFullWindow::hold_latest;
  SendStream stream(uplink, keeper, Peer{kPeerId}, options);
  stream.send("1", kForever, More::no).or_throw();
  connected.hub.send(proto::flow::Pause{{proto::Kind::unicast, proto::Lane::normal, kPeerId}});
  while (nif::test::counters_of(connected.node.get()).pauses == 0) std::this_thread::yield();
  stream.send("2", kForever, More::no).or_throw();
  EXPECT_TRUE(stream.on_ack(1, {kAll, 0, 0})) << "it may go, but for the pause";
  std::atomic<bool> over = false;
  std::atomic<std::size_t> gone = 0;
  std::vector<std::thread> looking;
  for (int i = 0; i < 4; ++i) {
    looking.emplace_back([&] {
      while (!over) gone += stream.counts().waiting == 1 ? 0 : 1;
    });
  }
  for (int i = 0; i < 200'000; ++i) EXPECT_TRUE(stream.tick(steady_now_ns()));
  over = true;
  for (std::thread& thread : looking) thread.join();
  EXPECT_EQ(gone, 0u);
  connected.hub.close();
}

}  // namespace
}  // namespace gimnet::gimi
