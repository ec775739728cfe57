#include "net/socket.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/tcp.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace gimnet::perf {
namespace {

struct Address {
  sockaddr_storage storage{};
  socklen_t size = 0;
  [[nodiscard]] sockaddr* get() { return reinterpret_cast<sockaddr*>(&storage); }
};

Address make_address(const Endpoint& endpoint) {
  Address address;
  if (endpoint.is_unix) {
    auto* const to = reinterpret_cast<sockaddr_un*>(&address.storage);
    to->sun_family = AF_UNIX;
    if (endpoint.host_or_path.size() >= sizeof(to->sun_path)) fail("the socket's path is too long");
    std::memcpy(to->sun_path, endpoint.host_or_path.c_str(), endpoint.host_or_path.size() + 1);
    address.size = sizeof(sockaddr_un);
    return address;
  }
  auto* const to = reinterpret_cast<sockaddr_in*>(&address.storage);
  to->sin_family = AF_INET;
  to->sin_port = htons(endpoint.port);
  if (inet_pton(AF_INET, endpoint.host_or_path.c_str(), &to->sin_addr) != 1)
    fail("not an IPv4 address");
  address.size = sizeof(sockaddr_in);
  return address;
}

int make_socket(const Endpoint& endpoint) {
  const int made = ::socket(endpoint.is_unix ? AF_UNIX : AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (made < 0) fail("cannot make a socket", errno);
  return made;
}

void make_nonblocking(int socket) {
  if (::fcntl(socket, F_SETFL, ::fcntl(socket, F_GETFL) | O_NONBLOCK) != 0)
    fail("cannot set O_NONBLOCK", errno);
}

}  // namespace

void fail(std::string_view what, int error) {
  std::fprintf(stderr, "%s: %.*s%s%s\n", program_invocation_short_name,
               static_cast<int>(what.size()), what.data(), error != 0 ? ": " : "",
               error != 0 ? std::strerror(error) : "");
  std::exit(1);
}

Endpoint parse_endpoint(std::string_view url) {
  Endpoint endpoint;
  if (url.starts_with("unix:")) {
    endpoint.is_unix = true;
    endpoint.host_or_path = url.substr(5);
    return endpoint;
  }
  const auto colon = url.rfind(':');
  if (!url.starts_with("tcp://") || colon < 6) fail("an address is tcp://HOST:PORT or unix:PATH");
  endpoint.host_or_path = url.substr(6, colon - 6);
  const auto port = url.substr(colon + 1);
  if (std::from_chars(port.data(), port.data() + port.size(), endpoint.port).ec != std::errc{})
    fail("a bad port");
  return endpoint;
}

void tune(int socket, const Endpoint& endpoint, int send_buffer_bytes) {
  const int on = 1;
  if (!endpoint.is_unix) ::setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
  if (send_buffer_bytes > 0) {
    ::setsockopt(socket, SOL_SOCKET, SO_SNDBUF, &send_buffer_bytes, sizeof(send_buffer_bytes));
  }
}

int connect_to(const Endpoint& endpoint) {
  const int socket = make_socket(endpoint);
  Address address = make_address(endpoint);
  // Blocking: on a loopback the kernel completes it by itself, unless the backlog is full.
  if (::connect(socket, address.get(), address.size) != 0)
    fail("cannot connect to " + endpoint.host_or_path, errno);
  tune(socket, endpoint, 0);
  make_nonblocking(socket);
  return socket;
}

int listen_on(const Endpoint& endpoint) {
  const int listener = make_socket(endpoint);
  Address address = make_address(endpoint);
  if (endpoint.is_unix) ::unlink(endpoint.host_or_path.c_str());
  if (::bind(listener, address.get(), address.size) != 0)
    fail("cannot bind " + endpoint.host_or_path, errno);
  if (::listen(listener, SOMAXCONN) != 0) fail("cannot listen on " + endpoint.host_or_path, errno);
  make_nonblocking(listener);
  return listener;
}

std::string local_url(int listener, const Endpoint& endpoint) {
  if (endpoint.is_unix) return "unix:" + endpoint.host_or_path;
  sockaddr_in address{};
  socklen_t size = sizeof(address);
  if (::getsockname(listener, reinterpret_cast<sockaddr*>(&address), &size) != 0)
    fail("getsockname", errno);
  return "tcp://" + endpoint.host_or_path + ":" + std::to_string(ntohs(address.sin_port));
}

void raise_descriptor_limit() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  limit.rlim_cur = limit.rlim_max;
  ::setrlimit(RLIMIT_NOFILE, &limit);
}

}  // namespace gimnet::perf
