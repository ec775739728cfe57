#pragma once

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "net/socket_stream.hpp"

namespace gimnet::net {

/// Descriptors of the two ends of a connection, which are the caller's.
struct ConnectedSockets {
  int near = -1;
  int far = -1;
};

[[nodiscard]] inline ConnectedSockets connect_by_unix() {
  int ends[2] = {-1, -1};
  EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends), 0);
  return {ends[0], ends[1]};
}

[[nodiscard]] inline ConnectedSockets connect_by_tcp() {
  const int listener = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  EXPECT_EQ(::bind(listener, reinterpret_cast<sockaddr*>(&address), size), 0);
  EXPECT_EQ(::listen(listener, 1), 0);
  EXPECT_EQ(::getsockname(listener, reinterpret_cast<sockaddr*>(&address), &size), 0);
  ConnectedSockets ends;
  ends.far = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  EXPECT_EQ(::connect(ends.far, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  ends.near = ::accept4(listener, nullptr, nullptr, SOCK_CLOEXEC);
  ::close(listener);
  return ends;
}

/// Over loopback or a Unix socket.
[[nodiscard]] inline ConnectedSockets connect_by(SocketStream::Family family) {
  return family == SocketStream::Family::unix_socket ? connect_by_unix() : connect_by_tcp();
}

}  // namespace gimnet::net
