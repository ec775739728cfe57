#include "net/socket.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/tcp.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <utility>

namespace gimnet::perf {
namespace {

const sockaddr* system_address(const gimnet::net::HostAddress& address) {
  return reinterpret_cast<const sockaddr*>(address.data());
}

int make_socket(const gimnet::net::HostAddress& address, int flags) {
  const int made =
      ::socket(system_address(address)->sa_family, SOCK_STREAM | SOCK_CLOEXEC | flags, 0);
  if (made < 0) fail("cannot make a socket", errno);
  return made;
}

}  // namespace

void fail(std::string_view what, int error) {
  std::fprintf(stderr, "%s: %.*s%s%s\n", program_invocation_short_name,
               static_cast<int>(what.size()), what.data(), error != 0 ? ": " : "",
               error != 0 ? std::strerror(error) : "");
  std::exit(1);
}

// An option of TCP is refused by a Unix socket, which needs none.
void tune(int socket, int send_buffer_bytes) {
  const int on = 1;
  ::setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
  if (send_buffer_bytes > 0) {
    ::setsockopt(socket, SOL_SOCKET, SO_SNDBUF, &send_buffer_bytes, sizeof(send_buffer_bytes));
  }
}

gimnet::net::HostAddress address_of(const std::string& url) {
  const auto address = gimnet::net::parse_address(url, 0);
  if (!address) fail(address.error().sentence);
  const gimnet::net::WakeSignal never;
  auto found = gimnet::net::find_addresses(*address, gimnet::net::kNever, never);
  if (!found) fail(found.error().sentence);
  return std::move(found->front());
}

int connect_to(const gimnet::net::HostAddress& address) {
  const int socket = make_socket(address, 0);
  // Blocking: on a loopback the kernel completes it by itself, unless the backlog is full.
  if (::connect(socket, system_address(address), static_cast<socklen_t>(address.size())) != 0)
    fail("cannot connect to the subject", errno);
  tune(socket, 0);
  if (::fcntl(socket, F_SETFL, ::fcntl(socket, F_GETFL) | O_NONBLOCK) != 0)
    fail("cannot set O_NONBLOCK", errno);
  return socket;
}

int listen_on(const std::string& url) {
  const gimnet::net::HostAddress address = address_of(url);
  const int listener = make_socket(address, SOCK_NONBLOCK);
  if (::bind(listener, system_address(address), static_cast<socklen_t>(address.size())) != 0 ||
      ::listen(listener, SOMAXCONN) != 0)
    fail("cannot listen on " + url, errno);
  return listener;
}

std::string local_url(int listener, const std::string& url) {
  sockaddr_in address{};
  socklen_t size = sizeof(address);
  if (::getsockname(listener, reinterpret_cast<sockaddr*>(&address), &size) != 0)
    fail("getsockname", errno);
  if (address.sin_family != AF_INET) return url;
  return url.substr(0, url.rfind(':') + 1) + std::to_string(ntohs(address.sin_port));
}

void raise_descriptor_limit() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  limit.rlim_cur = limit.rlim_max;
  ::setrlimit(RLIMIT_NOFILE, &limit);
}

}  // namespace gimnet::perf
