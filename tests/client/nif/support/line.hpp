#pragma once

#include <gtest/gtest.h>
#include <sys/socket.h>

#include <array>
#include <cstddef>
#include <memory>
#include <string_view>
#include <vector>

#include "client/nif/outbound.hpp"
#include "net/socket_stream.hpp"
#include "tests/client/nif/support/fake_hub.hpp"

namespace gimnet::nif::test {

/// The sending half of a node on a socket of its own, and that socket's other end. The test is the
/// library's thread.
struct Line {
  explicit Line(const SessionTerms& session = session_of(false)) { attach(session); }

  static SessionTerms session_of(bool resume) {
    SessionTerms session;
    session.id = kOwnId;
    session.frame_bytes_max = 65'536;
    session.resume = resume;
    return session;
  }

  void attach(const SessionTerms& session) {
    std::array<int, 2> ends{};
    ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, ends.data()), 0);
    socket = net::make_stream(ends[0], net::SocketStream::Family::unix_socket, {});
    peer = net::make_stream(ends[1], net::SocketStream::Family::unix_socket, {});
    EXPECT_TRUE(outbound.attach(*socket, session));
  }

  [[nodiscard]] nif_status send(std::string_view payload, Deadline deadline = 0) {
    nif_outgoing message = NIF_OUTGOING_INIT;
    message.to = kPeerId;
    return send(message, payload, deadline);
  }
  [[nodiscard]] nif_status send(nif_outgoing message, std::string_view payload, Deadline deadline) {
    const nif_bytes part = {payload.data(), payload.size()};
    message.parts = &part;
    message.part_count = 1;
    Outgoing outgoing;
    EXPECT_FALSE(outgoing.read(message));
    return outbound.send(outgoing, deadline);
  }

  /// The library's thread was asked to write.
  [[nodiscard]] bool woken() const { return net::wait_for(nullptr, {}, wake, 0).woken; }

  /// Returns the bytes that were written by now.
  [[nodiscard]] std::vector<std::byte> read() {
    std::vector<std::byte> all;
    std::array<std::byte, 4096> some;
    for (;;) {
      const net::IoResult result = peer->receive(some);
      if (result.status != net::IoStatus::ok) return all;
      all.insert(all.end(), some.begin(), some.begin() + static_cast<std::ptrdiff_t>(result.bytes));
    }
  }

  net::WakeSignal wake;
  Outbound outbound{{}, wake};
  std::unique_ptr<net::Stream> socket;
  std::unique_ptr<net::Stream> peer;
};

}  // namespace gimnet::nif::test
