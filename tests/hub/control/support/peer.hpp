#pragma once

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hub/control/acceptor.hpp"
#include "net/socket_stream.hpp"
#include "proto/control/link.hpp"
#include "tests/net/support/link_frames.hpp"

namespace gimnet::hub {

using net::link_frame;
using net::opening_and;

/// The far end of a connection, as a test holds it.
class Peer {
 public:
  Peer() {
    int ends[2] = {-1, -1};
    EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, ends), 0);
    descriptor_ = ends[0];
    near_.transport =
        std::make_unique<net::SocketStream>(ends[1], net::SocketStream::Family::unix_socket);
    near_.peer = PeerInfo{"unix", "pid 1 uid 2"};
  }
  ~Peer() { close(); }
  Peer(Peer&& other) noexcept
      : descriptor_(std::exchange(other.descriptor_, -1)), near_(std::move(other.near_)) {}
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;

  /// The hub's end.
  Stranger take_stranger() { return std::move(near_); }

  void send(std::span<const std::byte> bytes) {
    EXPECT_EQ(::send(descriptor_, bytes.data(), bytes.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(bytes.size()));
  }
  void send(std::string_view text) { send(std::as_bytes(std::span{text})); }

  /// All that has come so far; `closed()` is true once the hub's end is closed.
  std::vector<std::byte> receive() {
    std::vector<std::byte> all;
    std::byte block[4096];
    for (;;) {
      const ssize_t count = ::recv(descriptor_, block, sizeof block, MSG_DONTWAIT);
      if (count == 0) closed_ = true;
      if (count < 0 && errno != EAGAIN) closed_ = true;
      if (count <= 0) return all;
      all.insert(all.end(), block, block + count);
    }
  }
  [[nodiscard]] bool closed() const { return closed_; }

  /// The GOODBYE that came after the opening, if that is what came.
  std::optional<proto::Goodbye> receive_goodbye() {
    const std::vector<std::byte> bytes = receive();
    constexpr std::size_t kBefore = proto::kOpeningSize + proto::kHeaderSize;
    if (bytes.size() < kBefore) return std::nullopt;
    const auto goodbye = proto::decode<proto::Goodbye>(std::span{bytes}.subspan(kBefore));
    return goodbye ? std::optional{*goodbye} : std::nullopt;
  }

  void close() {
    if (descriptor_ >= 0) ::close(std::exchange(descriptor_, -1));
  }

 private:
  int descriptor_ = -1;
  Stranger near_;
  bool closed_ = false;
};

}  // namespace gimnet::hub
