// The cost of one hop of a small message by the way to wait for readiness: level-triggered epoll,
// as the shards do it, or Boost.Asio's async_wait with its handlers run in one batch. A single
// thread plays sender, hub and receiver, so nobody sleeps and only the work is measured. The
// figures stand in docs/adr/0005-readiness-by-epoll.md.

#include <benchmark/benchmark.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <boost/asio/io_context.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "hub/shard/poller.hpp"

namespace gimnet::hub {
namespace {

constexpr std::size_t kMessageBytes = 32;
constexpr std::size_t kBufferBytes = 256 * 1024;

struct Pair {
  int outside = -1;
  int inside = -1;
};

Pair connect_loopback() {
  const int listener = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  Pair pair;
  pair.outside = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (::bind(listener, reinterpret_cast<sockaddr*>(&address), size) != 0 ||
      ::listen(listener, 1) != 0 ||
      ::getsockname(listener, reinterpret_cast<sockaddr*>(&address), &size) != 0 ||
      ::connect(pair.outside, reinterpret_cast<sockaddr*>(&address), size) != 0) {
    throw std::runtime_error("no loopback connection");
  }
  pair.inside = ::accept4(listener, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
  ::close(listener);
  const int on = 1;
  ::setsockopt(pair.outside, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  ::setsockopt(pair.inside, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  return pair;
}

/// Two connections of a hub that relays from the first to the second.
class Relay {
 public:
  Relay() : from_(connect_loopback()), to_(connect_loopback()), buffer_(kBufferBytes) {}
  ~Relay() {
    for (const int descriptor : {from_.outside, from_.inside, to_.outside, to_.inside})
      ::close(descriptor);
  }
  Relay(const Relay&) = delete;
  Relay& operator=(const Relay&) = delete;

  [[nodiscard]] int from() const { return from_.inside; }
  [[nodiscard]] int to() const { return to_.inside; }
  void relay() {
    const ssize_t bytes = ::recv(from_.inside, buffer_.data(), buffer_.size(), MSG_DONTWAIT);
    if (bytes > 0)
      static_cast<void>(
          ::send(to_.inside, buffer_.data(), static_cast<std::size_t>(bytes), MSG_NOSIGNAL));
  }
  void send_outside() {
    static_cast<void>(::send(from_.outside, message_.data(), message_.size(), MSG_NOSIGNAL));
  }
  void receive_outside() {
    static_cast<void>(::recv(to_.outside, message_.data(), message_.size(), MSG_WAITALL));
  }

 private:
  Pair from_;
  Pair to_;
  std::vector<std::byte> buffer_;
  std::array<std::byte, kMessageBytes> message_{};
};

void bm_hop_level_triggered(benchmark::State& state) {
  Relay relay;
  Poller poller;
  if (!poller.add(relay.from(), 1, {.read = true, .write = false}) ||
      !poller.add(relay.to(), 2, {.read = true, .write = false})) {
    return state.SkipWithError("epoll refuses");
  }
  for (auto _ : state) {
    relay.send_outside();
    for (const Ready& ready : poller.wait(-1)) {
      if (ready.token == 1) relay.relay();
    }
    relay.receive_outside();
  }
}
BENCHMARK(bm_hop_level_triggered);

void bm_hop_asio_wait(benchmark::State& state) {
  Relay relay;
  boost::asio::io_context context(1);
  boost::asio::posix::stream_descriptor from(context, ::dup(relay.from()));
  bool ready = false;
  for (auto _ : state) {
    relay.send_outside();
    ready = false;
    from.async_wait(boost::asio::posix::stream_descriptor::wait_read,
                    [&ready](const boost::system::error_code&) { ready = true; });
    // A turn is what is ready now: one handler to sleep for, and the rest of the batch without
    // sleeping.
    context.restart();
    context.run_one();
    context.poll();
    if (ready) relay.relay();
    relay.receive_outside();
  }
}
BENCHMARK(bm_hop_asio_wait);

}  // namespace
}  // namespace gimnet::hub
