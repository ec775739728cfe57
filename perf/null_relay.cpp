// The yardstick: the cheapest relay in user space. One thread, epoll, recv into one buffer of 256
// KiB, send of the same bytes, no parsing. What a hub costs beyond this is the hub's own doing.
//
//     null_relay --mode pair|fan_out --listen tcp://127.0.0.1:0 --listen unix:/path [--send-buffer
//     BYTES]
//
// Connections are numbered as they are accepted. Pair mode: 2k to 2k+1 and back. Fan-out mode: 0 to
// all others; what the others send is read and thrown away. Prints `ready URL ...` when it listens.

#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <array>
#include <cerrno>
#include <cstdio>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "net/socket.hpp"

namespace gimnet::perf {
namespace {

constexpr std::size_t kReadBytes = 256 * 1024;
constexpr std::size_t kEventsMax = 1024;
constexpr std::uint64_t kListenerFlag = 1ull << 63;

enum class Mode { pair, fan_out };

struct Connection {
  int socket = -1;
  std::vector<std::byte> unsent;  ///< what the kernel did not take yet
  std::size_t unsent_begin = 0;   ///< bytes of it sent since
  std::size_t waiting_for_count =
      0;  ///< connections that still hold unsent bytes of this one: it is not read
};

class Relay {
 public:
  Relay(Mode mode, int send_buffer_bytes) : mode_(mode), send_buffer_bytes_(send_buffer_bytes) {}

  std::string listen(const std::string& url) {
    const int listener = listen_on(url);
    watch(EPOLL_CTL_ADD, listener, kListenerFlag | listeners_.size(), EPOLLIN);
    listeners_.push_back(listener);
    return local_url(listener, url);
  }

  [[noreturn]] void run() {
    std::array<epoll_event, kEventsMax> events;
    for (;;) {
      const int count = ::epoll_wait(epoll_, events.data(), kEventsMax, -1);
      if (count < 0 && errno != EINTR) fail("epoll_wait", errno);
      const std::span ready(events.data(), static_cast<std::size_t>(count > 0 ? count : 0));
      // Listeners first, so that what connection 0 sends reaches everybody who connected before it
      // was sent.
      for (const auto& event : ready) {
        if ((event.data.u64 & kListenerFlag) != 0)
          accept_all(listeners_[event.data.u64 & ~kListenerFlag]);
      }
      for (const auto& event : ready) {
        if ((event.data.u64 & kListenerFlag) == 0) handle(event.data.u64, event.events);
      }
    }
  }

 private:
  void watch(int operation, int descriptor, std::uint64_t tag, std::uint32_t interest) const {
    epoll_event event{};
    event.events = interest;
    event.data.u64 = tag;
    if (::epoll_ctl(epoll_, operation, descriptor, &event) != 0) fail("epoll_ctl", errno);
  }

  void accept_all(int listener) {
    for (;;) {
      const int accepted = ::accept4(listener, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
      if (accepted < 0) {
        if (errno == EAGAIN || errno == EINTR || errno == ECONNABORTED) return;
        fail("accept", errno);
      }
      tune(accepted, send_buffer_bytes_);
      watch(EPOLL_CTL_ADD, accepted, connections_.size(), EPOLLIN);
      connections_.push_back({.socket = accepted, .unsent = {}});
    }
  }

  void handle(std::size_t index, std::uint32_t events) {
    if (connections_[index].socket < 0) return;
    if ((events & EPOLLOUT) != 0) send_rest(index);
    const Connection& connection = connections_[index];
    if (connection.socket < 0 || connection.waiting_for_count != 0) return;
    if ((events & (EPOLLIN | EPOLLHUP | EPOLLERR)) != 0) read_once(index);
  }

  void read_once(std::size_t index) {
    const ssize_t size = ::recv(connections_[index].socket, buffer_.get(), kReadBytes, 0);
    if (size < 0 && (errno == EAGAIN || errno == EINTR)) return;
    if (size <= 0) return close(index);
    const std::span bytes(buffer_.get(), static_cast<std::size_t>(size));
    if (mode_ == Mode::pair) {
      const std::size_t other = index ^ 1;
      if (other < connections_.size()) forward(index, other, bytes);
    } else if (index == 0) {
      for (std::size_t to = 1; to < connections_.size(); ++to) forward(0, to, bytes);
    }
    if (connections_[index].waiting_for_count != 0) update_interest(index);
  }

  void forward(std::size_t from, std::size_t to, std::span<const std::byte> bytes) {
    Connection& receiver = connections_[to];
    if (receiver.socket < 0) return;
    const ssize_t sent = ::send(receiver.socket, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent < 0 && errno != EAGAIN) return close(to);
    const auto taken = static_cast<std::size_t>(sent < 0 ? 0 : sent);
    if (taken == bytes.size()) return;
    receiver.unsent.assign(bytes.begin() + static_cast<std::ptrdiff_t>(taken), bytes.end());
    receiver.unsent_begin = 0;
    ++connections_[from].waiting_for_count;
    update_interest(to);
  }

  void send_rest(std::size_t index) {
    Connection& receiver = connections_[index];
    const std::size_t left = receiver.unsent.size() - receiver.unsent_begin;
    const ssize_t sent =
        ::send(receiver.socket, receiver.unsent.data() + receiver.unsent_begin, left, MSG_NOSIGNAL);
    if (sent < 0) {
      if (errno != EAGAIN) close(index);
      return;
    }
    receiver.unsent_begin += static_cast<std::size_t>(sent);
    if (receiver.unsent_begin == receiver.unsent.size()) forget_unsent(index);
  }

  /// The sender of what waited here is read again when nobody else keeps it waiting.
  void forget_unsent(std::size_t index) {
    Connection& receiver = connections_[index];
    if (receiver.unsent.empty()) return;
    receiver.unsent.clear();
    if (receiver.socket >= 0) update_interest(index);
    const std::size_t sender = mode_ == Mode::pair ? index ^ 1 : 0;
    if (--connections_[sender].waiting_for_count == 0 && connections_[sender].socket >= 0)
      update_interest(sender);
  }

  void update_interest(std::size_t index) const {
    const Connection& connection = connections_[index];
    const auto read = connection.waiting_for_count == 0 ? std::uint32_t{EPOLLIN} : 0u;
    const auto write = connection.unsent.empty() ? 0u : std::uint32_t{EPOLLOUT};
    watch(EPOLL_CTL_MOD, connection.socket, index, read | write);
  }

  void close(std::size_t index) {
    ::close(connections_[index].socket);
    connections_[index].socket = -1;
    forget_unsent(index);
  }

  const Mode mode_;
  const int send_buffer_bytes_;
  const int epoll_ = ::epoll_create1(EPOLL_CLOEXEC);
  std::vector<int> listeners_;
  std::vector<Connection> connections_;
  std::unique_ptr<std::byte[]> buffer_ = std::make_unique<std::byte[]>(kReadBytes);
};

}  // namespace
}  // namespace gimnet::perf

int main(int argc, char** argv) {
  CLI::App app{"null_relay: passes bytes on, unread"};
  std::string mode = "pair";
  std::vector<std::string> urls;
  int send_buffer_bytes = 256 * 1024;
  app.add_option("--mode", mode)->check(CLI::IsMember({"pair", "fan_out"}));
  app.add_option("--listen", urls, "tcp://HOST:PORT or unix:PATH, repeatable")->required();
  app.add_option("--send-buffer", send_buffer_bytes, "SO_SNDBUF in bytes, 0: the system's own");
  CLI11_PARSE(app, argc, argv);

  gimnet::perf::raise_descriptor_limit();
  gimnet::perf::Relay relay(mode == "pair" ? gimnet::perf::Mode::pair : gimnet::perf::Mode::fan_out,
                            send_buffer_bytes);
  std::string ready = "ready";
  for (const auto& url : urls) ready += " " + relay.listen(url);
  std::puts(ready.c_str());
  std::fflush(stdout);
  relay.run();
}
