#include "client/nif/message_sender.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "tests/client/nif/support/frames.hpp"
#include "tests/client/nif/support/short_stream.hpp"

// A sender without a hub. Its windows, reports and time limits at a hub are in
// outbound_send_test.cpp.

namespace gimnet::nif::test {
namespace {

constexpr std::uint32_t kSelf = (7u << 20) | 5;
constexpr std::uint32_t kGroup = 11;
constexpr std::size_t kHeldMax = 256 * 1024;

/// A sender with all that it needs, and no hub.
struct Alone final : SocketWriter::Source {
  explicit Alone(bool resume = false) {
    frames.begin_session(kSelf, 65'536);
    queue.set_resume(resume);
    writer.attach(stream);
  }
  void refill() override {}
  [[nodiscard]] bool has_more() const override { return false; }

  nif_status send(nif_outgoing given, std::string_view payload, Deadline deadline = 0) {
    const nif_bytes part = {payload.data(), payload.size()};
    given.parts = &part;
    given.part_count = 1;
    Outgoing message;
    EXPECT_FALSE(message.read(given));
    const MutexLock lock(mutex);
    return sender.send(message, deadline, mutex);
  }

  net::WakeSignal wake;
  Mutex mutex;
  SendQueue queue{{}};
  ConnectionState connection;
  Waiters waiters;
  PauseTable pauses;
  GroupMoves moves;
  SendGate gate{pauses, moves, queue};
  FrameAppender frames{queue};
  MessagesUnderWay under_way{kHeldMax};
  LastMessages last;
  ShortStream stream;
  SocketWriter writer{{queue, frames.appended(), *this, connection, waiters, wake}};
  MessageSender sender{{connection, queue, gate, frames, under_way, writer, waiters, last}};
};

nif_outgoing to_group(std::uint32_t group) {
  nif_outgoing given = NIF_OUTGOING_INIT;
  given.kind = NIF_GROUP;
  given.to = group;
  return given;
}

TEST(MessageSender, WithoutAConnectionAMessageWaitsOnlyIfTheSessionMayBeResumed) {
  nif_outgoing given = to_group(kGroup);
  EXPECT_EQ(Alone(false).send(given, "lost"), NIF_NOT_CONNECTED);
  EXPECT_EQ(Alone(true).send(given, "no room"), NIF_TIMEOUT);
  given.flags = NIF_FLAG_NOT_WHILE_AWAY;
  EXPECT_EQ(Alone(true).send(given, "now or never"), NIF_NOT_CONNECTED);
}

TEST(MessageSender, AMessageGoesToTheGroupThatItsServiceHasNowOrIsRefused) {
  Alone node;
  node.connection.connect();
  node.moves.add({{kGroup, 99}, {12, 0}});
  EXPECT_EQ(node.send(to_group(kGroup), "moved"), NIF_OK);
  EXPECT_EQ(node.send(to_group(12), "refused"), NIF_REFUSED);
  EXPECT_EQ(node.stream.taken(), std::vector<std::string>{"moved"});
  EXPECT_EQ(node.sender.messages_sent(), 1u);
}

TEST(MessageSender, TellsThatTheHubDoesNotKeepALargerLastMessage) {
  Alone node;
  node.connection.connect();
  node.sender.set_hub_retains(4);
  EXPECT_EQ(node.send(to_group(kGroup), "of no retained service"), NIF_OK);
  node.last.follow("map", kGroup);
  EXPECT_EQ(node.send(to_group(kGroup), "1234"), NIF_OK);
  EXPECT_EQ(node.send(to_group(kGroup), "12345"), NIF_NOT_RETAINED);
  EXPECT_EQ(node.stream.taken().back(), "12345") << "it went";
  EXPECT_NE(node.last.find("map"), nullptr);
}

TEST(MessageSender, TheLibraryGoesOnWithALargeMessageWhoseTimeIsOver) {
  Alone node;
  node.connection.connect();
  node.stream.room = 0;
  EXPECT_EQ(node.send(to_group(kGroup), std::string(1u << 20, 'l')), NIF_OK);
  EXPECT_TRUE(node.under_way.holds_any());
  EXPECT_EQ(node.send(to_group(kGroup), "behind it"), NIF_TIMEOUT);
}

}  // namespace
}  // namespace gimnet::nif::test
