#include "net/socket_stream.hpp"

#include <gtest/gtest.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <memory>
#include <utility>
#include <vector>

#include "tests/net/support/connected_sockets.hpp"

namespace gimnet::net {
namespace {

using Family = SocketStream::Family;

constexpr SocketOptions kSizes{.send_bytes = 256 * 1'024};

/// The hub's end as a transport, and the far end's descriptor.
struct Ends {
  std::unique_ptr<SocketStream> near;
  int far = -1;
  ~Ends() {
    if (far >= 0) ::close(far);
  }
};

std::unique_ptr<Ends> connect(Family family, const SocketOptions& options) {
  const ConnectedSockets sockets = connect_by(family);
  auto ends = std::make_unique<Ends>();
  ends->near = std::make_unique<SocketStream>(sockets.near, family, options);
  ends->far = sockets.far;
  return ends;
}
std::unique_ptr<Ends> unix_ends(const SocketOptions& options = kSizes) {
  return connect(Family::unix_socket, options);
}
std::unique_ptr<Ends> tcp_ends(const SocketOptions& options = kSizes) {
  return connect(Family::tcp, options);
}

iovec piece(std::string_view text) { return {const_cast<char*>(text.data()), text.size()}; }

int option(int descriptor, int level, int name) {
  int value = -1;
  socklen_t size = sizeof value;
  EXPECT_EQ(::getsockopt(descriptor, level, name, &value, &size), 0);
  return value;
}

/// Sends until nothing is taken any more; returns how many bytes were.
std::size_t fill(SocketStream& transport) {
  const std::vector<std::byte> block(64 * 1'024);
  std::size_t total = 0;
  for (;;) {
    const iovec one{const_cast<std::byte*>(block.data()), block.size()};
    const IoResult result = transport.send({&one, 1});
    if (result.status != IoStatus::ok) return total;
    total += result.bytes;
  }
}

TEST(SocketStream, SendsGatheredPiecesInOrder) {
  for (const auto& ends : {unix_ends(), tcp_ends()}) {
    const std::array<iovec, 3> pieces{piece("one "), piece("two "), piece("three")};
    const IoResult sent = ends->near->send(pieces);
    EXPECT_EQ(sent.status, IoStatus::ok);
    EXPECT_EQ(sent.bytes, 13u);
    std::array<char, 32> text{};
    EXPECT_EQ(::recv(ends->far, text.data(), text.size(), 0), 13);
    EXPECT_STREQ(text.data(), "one two three");
  }
}

TEST(SocketStream, ReceivesWithoutWaiting) {
  const auto ends = unix_ends();
  std::array<std::byte, 4> room{};
  EXPECT_EQ(ends->near->receive(room).status, IoStatus::would_block);
  ASSERT_EQ(::send(ends->far, "abcdef", 6, 0), 6);
  const IoResult first = ends->near->receive(room);
  EXPECT_EQ(first.status, IoStatus::ok);
  EXPECT_EQ(first.bytes, 4u);
  EXPECT_EQ(ends->near->receive(room).bytes, 2u);
  EXPECT_EQ(ends->near->receive(room).status, IoStatus::would_block);
}

TEST(SocketStream, TellsAnOrderlyEndFromABrokenOne) {
  const auto orderly = tcp_ends();
  ::close(std::exchange(orderly->far, -1));
  std::array<std::byte, 4> room{};
  EXPECT_EQ(orderly->near->receive(room).status, IoStatus::closed);

  const auto broken = tcp_ends();
  const linger at_once{1, 0};
  ASSERT_EQ(::setsockopt(broken->far, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once), 0);
  ::close(std::exchange(broken->far, -1));
  EXPECT_EQ(broken->near->receive(room).status, IoStatus::failed);
  // The kernel tells that once, perhaps to who reads twice and only looks at the first; it stays an
  // end.
  EXPECT_NE(broken->near->receive(room).status, IoStatus::would_block);
}

TEST(SocketStream, ThePeerSeesTheEndBehindWhatWasSent) {
  for (const auto& ends : {unix_ends(), tcp_ends()}) {
    const iovec one = piece("last");
    EXPECT_EQ(ends->near->send({&one, 1}).bytes, 4u);
    ends->near->shut_down();
    std::array<char, 8> text{};
    EXPECT_EQ(::recv(ends->far, text.data(), text.size(), 0), 4);
    EXPECT_EQ(::recv(ends->far, text.data(), text.size(), 0), 0);
    EXPECT_EQ(ends->near->send({&one, 1}).status, IoStatus::failed);
    ASSERT_EQ(::send(ends->far, "still read", 10, 0), 10);
    std::array<std::byte, 16> room{};
    EXPECT_EQ(ends->near->receive(room).bytes, 10u);
  }
}

TEST(SocketStream, KeepsNothingOfItsOwn) {
  const auto ends = unix_ends();
  EXPECT_GT(fill(*ends->near), 0u);
  EXPECT_EQ(ends->near->pending_out(), 0u);
  EXPECT_EQ(ends->near->pending_in(), 0u);
  EXPECT_EQ(ends->near->send({}).status, IoStatus::ok);
}

TEST(SocketStream, SendingToNobodyFailsWithoutASignal) {
  const auto ends = unix_ends();
  ::close(std::exchange(ends->far, -1));
  const iovec one = piece("x");
  EXPECT_EQ(ends->near->send({&one, 1}).status, IoStatus::failed);
}

TEST(SocketStream, AFullSocketTakesNoMoreAndSaysHowMuchWaits) {
  for (const auto& ends : {unix_ends(), tcp_ends()}) {
    EXPECT_EQ(ends->near->unsent_bytes(), 0u);
    EXPECT_GT(fill(*ends->near), 0u);
    EXPECT_GT(ends->near->unsent_bytes(), 0u);
  }
}

TEST(SocketStream, SetsItsOptions) {
  const auto ends = tcp_ends({.receive_bytes = 64 * 1'024, .send_bytes = 128 * 1'024});
  // The kernel reports twice what was asked for.
  EXPECT_EQ(option(ends->near->descriptor(), SOL_SOCKET, SO_SNDBUF), 2 * 128 * 1'024);
  EXPECT_EQ(option(ends->near->descriptor(), SOL_SOCKET, SO_RCVBUF), 2 * 64 * 1'024);
  EXPECT_NE(option(ends->near->descriptor(), IPPROTO_TCP, TCP_NODELAY), 0);
}

TEST(SocketStream, LimitsWhatWaitsUnsentOnTcp) {
  const auto ends = tcp_ends();
  ends->near->limit_unsent(16'384);
  EXPECT_EQ(option(ends->near->descriptor(), IPPROTO_TCP, TCP_NOTSENT_LOWAT), 16'384);
  ends->near->limit_unsent(1);
  EXPECT_EQ(option(ends->near->descriptor(), IPPROTO_TCP, TCP_NOTSENT_LOWAT), 4'096);
}

TEST(SocketStream, LimitsHowLongWhatWasSentIsNotAcknowledged) {
  const auto ends = tcp_ends();
  EXPECT_EQ(option(ends->near->descriptor(), IPPROTO_TCP, TCP_USER_TIMEOUT), 0)
      << "the system's own";
  for (const std::uint32_t ms : {100u, 15'000u, 3'600'000u, 0u}) {
    ends->near->limit_unacknowledged(ms);
    EXPECT_EQ(option(ends->near->descriptor(), IPPROTO_TCP, TCP_USER_TIMEOUT),
              static_cast<int>(ms));
  }
  unix_ends()->near->limit_unacknowledged(1'000);
}

TEST(SocketStream, LimitsWhatWaitsUnsentOnUnixSockets) {
  const auto limited = unix_ends();
  limited->near->limit_unsent(16'384);
  const auto free = unix_ends();
  EXPECT_LT(fill(*limited->near), fill(*free->near));
}

TEST(SocketStream, ABoundOfWhatWaitsUnsentDoesNotRaiseTheBufferOfAUnixSocket) {
  const auto ends = unix_ends({.send_bytes = 16 * 1'024});
  const int whole = option(ends->near->descriptor(), SOL_SOCKET, SO_SNDBUF);
  for (const std::uint32_t bytes : {16u * 1'024 + 1, 128u * 1'024, 1u << 30, 0u}) {
    ends->near->limit_unsent(bytes);
    EXPECT_EQ(option(ends->near->descriptor(), SOL_SOCKET, SO_SNDBUF), whole) << bytes;
  }
  ends->near->limit_unsent(8 * 1'024);
  EXPECT_EQ(option(ends->near->descriptor(), SOL_SOCKET, SO_SNDBUF), whole / 2);
}

}  // namespace
}  // namespace gimnet::net
