#include "impair/fault_proxy.hpp"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <list>
#include <random>
#include <thread>
#include <vector>

#include "base/clock.hpp"
#include "base/mutex.hpp"
#include "net/host_lookup.hpp"

namespace gimnet::impair {
namespace {

using End = RelayedConnection::End;
using Flow = RelayedConnection::Flow;

constexpr std::int64_t kNever = DelayedChannel::kNever;
constexpr int kBacklog = 128;
/// A connection for which the system has no descriptor or memory waits so long in the listen
/// queue: polled again at once, it would be readable and not to be had.
constexpr std::int64_t kAcceptAgainNs = 50'000'000;

const sockaddr* get(const net::HostAddress& address) {
  return reinterpret_cast<const sockaddr*>(address.data());
}

socklen_t size_of(const net::HostAddress& address) {
  return static_cast<socklen_t>(address.size());
}

/// The first address; waits for the look-up of its host.
Result<net::HostAddress> find(const net::Address& address) {
  const net::WakeSignal never;
  auto found = net::find_addresses(address, net::kNever, never);
  if (!found) return Error{std::move(found.error().sentence)};
  return std::move(found->front());
}

int open_socket(const net::HostAddress& address) {
  const int made = ::socket(get(address)->sa_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  const int on = 1;
  // Pieces leave as they are due. Fails on Unix sockets, which do not join them.
  static_cast<void>(::setsockopt(made, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on));
  return made;
}

/// The address of a listening socket: the one that was asked for, with the port that the system
/// chose.
net::Address bound(net::Address address, int descriptor) {
  sockaddr_storage bytes{};
  socklen_t size = sizeof bytes;
  static_cast<void>(::getsockname(descriptor, reinterpret_cast<sockaddr*>(&bytes), &size));
  if (bytes.ss_family == AF_INET6)
    address.port = ntohs(reinterpret_cast<const sockaddr_in6&>(bytes).sin6_port);
  if (bytes.ss_family == AF_INET)
    address.port = ntohs(reinterpret_cast<const sockaddr_in&>(bytes).sin_port);
  return address;
}

bool would_block(int error) { return error == EAGAIN || error == EWOULDBLOCK || error == EINTR; }

}  // namespace

/// The thread and what it owns. Everything below "loop" belongs to that thread; what others change
/// is behind the mutex, and the event wakes the thread.
class FaultProxy::Relay {
 public:
  Relay(int listener, const net::Address& address, net::HostAddress target, const Impairment& how,
        std::uint64_t seed)
      : listener_(listener),
        url_(address.url()),
        path_(address.path),
        target_(std::move(target)),
        event_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
        orders_{.how = how},
        random_(seed) {
    thread_ = std::thread([this] { loop(); });
  }

  ~Relay() {
    order([](Orders& orders) { orders.ends = true; });
    thread_.join();
    if (!path_.empty()) ::unlink(path_.c_str());
  }

  struct Orders {
    std::uint64_t number = 0;
    Impairment how;
    bool ends = false;
    bool refuses = false;
    std::uint64_t cuts = 0;
    std::array<std::int64_t, 2> stalled_until_ns{INT64_MIN, INT64_MIN};
  };

  /// Changes the orders, and waits until the thread has obeyed them.
  template <class Change>
  void order(Change change) GIMNET_EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    change(orders_);
    const std::uint64_t number = ++orders_.number;
    static_cast<void>(::eventfd_write(event_.get(), 1));
    while (obeyed_ < number) obeyed_changed_.wait(mutex_);
  }
  [[nodiscard]] Orders orders() const GIMNET_EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    return orders_;
  }
  [[nodiscard]] Relayed relayed() const GIMNET_EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    return relayed_;
  }
  [[nodiscard]] const std::string& url() const { return url_; }

 private:
  void loop();
  void take_orders(std::int64_t now_ns);
  void wait();
  void accept_all(std::int64_t now_ns);
  void serve(RelayedConnection& connection, std::int64_t now_ns);
  void read(Flow& flow, const End& from, std::int64_t now_ns);
  void write(RelayedConnection& connection, Flow& flow, const End& to, RelayDirection way,
             std::int64_t now_ns);
  /// Nothing of this way is written before.
  [[nodiscard]] std::int64_t stalled_until_ns(RelayDirection way) const;
  [[nodiscard]] std::int64_t drawn(std::int64_t now_ns, std::int64_t mean_ns);

  const Descriptor listener_;
  const std::string url_;
  const std::string path_;  ///< of a Unix socket
  const net::HostAddress target_;
  const Descriptor event_;
  mutable Mutex mutex_;
  Orders orders_ GIMNET_GUARDED_BY(mutex_);
  Relayed relayed_ GIMNET_GUARDED_BY(mutex_);
  std::uint64_t obeyed_ GIMNET_GUARDED_BY(mutex_) = 0;  ///< number of the last orders
  Condition obeyed_changed_;
  std::thread thread_;

  // loop
  std::mt19937_64 random_;
  Orders now_;  ///< of this turn
  Relayed done_;
  std::uint64_t cuts_done_ = 0;
  std::int64_t accept_at_ns_ = INT64_MIN;  ///< the listener is not polled before
  std::int64_t next_stall_ns_ = kNever;
  std::int64_t next_cut_ns_ = kNever;
  std::int64_t drawn_stall_end_ns_ = INT64_MIN;
  std::list<RelayedConnection> connections_;  ///< Limit: kConnections.
  std::vector<pollfd> polled_;
  std::array<std::byte, std::size_t{64} << 10> buffer_{};
};

std::int64_t FaultProxy::Relay::drawn(std::int64_t now_ns, std::int64_t mean_ns) {
  if (mean_ns == 0) return kNever;
  std::exponential_distribution<double> wait(1.0 / static_cast<double>(mean_ns));
  return now_ns + static_cast<std::int64_t>(wait(random_));
}

std::int64_t FaultProxy::Relay::stalled_until_ns(RelayDirection way) const {
  return std::max(drawn_stall_end_ns_, now_.stalled_until_ns[way == RelayDirection::up ? 0 : 1]);
}

void FaultProxy::Relay::loop() {
  for (;;) {
    const std::int64_t now_ns = steady_now_ns();
    take_orders(now_ns);
    if (!now_.ends) {
      for (RelayedConnection& connection : connections_) serve(connection, now_ns);
      accept_all(now_ns);
    }
    std::erase_if(connections_,
                  [](const RelayedConnection& connection) { return connection.is_over; });
    done_.connections = connections_.size();
    {
      const MutexLock lock(mutex_);
      relayed_ = done_;
      obeyed_ = now_.number;
      obeyed_changed_.notify_all();
    }
    if (now_.ends) return;
    wait();
  }
}

void FaultProxy::Relay::take_orders(std::int64_t now_ns) {
  const Impairment before = now_.how;
  now_ = orders();
  if (now_.how.stall_every_ns != before.stall_every_ns)
    next_stall_ns_ = drawn(now_ns, now_.how.stall_every_ns);
  if (now_.how.cut_every_ns != before.cut_every_ns)
    next_cut_ns_ = drawn(now_ns, now_.how.cut_every_ns);
  if (now_ns >= next_stall_ns_) {
    ++done_.stalls;
    drawn_stall_end_ns_ = now_ns + now_.how.stall_for_ns;
    next_stall_ns_ = drawn(drawn_stall_end_ns_, now_.how.stall_every_ns);
  }
  const bool cut_now = now_ns >= next_cut_ns_;
  if (cut_now) next_cut_ns_ = drawn(now_ns, now_.how.cut_every_ns);
  if (!cut_now && cuts_done_ == now_.cuts) return;
  cuts_done_ = now_.cuts;
  done_.cut += connections_.size();
  for (RelayedConnection& connection : connections_) connection.end_by_reset();
}

void FaultProxy::Relay::accept_all(std::int64_t now_ns) {
  accept_at_ns_ = INT64_MIN;
  while (connections_.size() < kConnections) {
    const int accepted = ::accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (accepted < 0) {
      const bool exhausted =
          errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM;
      if (exhausted) accept_at_ns_ = now_ns + kAcceptAgainNs;
      return;
    }
    const int on = 1;
    static_cast<void>(::setsockopt(accepted, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on));
    ++done_.accepted;
    RelayedConnection& connection =
        connections_.emplace_back(accepted, open_socket(target_), random_());
    if (now_.refuses ||
        (::connect(connection.target.socket.get(), get(target_), size_of(target_)) != 0 &&
         errno != EINPROGRESS)) {
      ++done_.refused;
      connection.end_by_reset();
    }
  }
}

void FaultProxy::Relay::serve(RelayedConnection& connection, std::int64_t now_ns) {
  if (connection.is_over) return;
  if (connection.is_connecting && connection.target.ready != 0) {
    int error = 0;
    socklen_t size = sizeof error;
    ::getsockopt(connection.target.socket.get(), SOL_SOCKET, SO_ERROR, &error, &size);
    if (error != 0) {
      ++done_.refused;
      return connection.end_by_reset();
    }
    connection.is_connecting = false;
    connection.target.ready = 0;
  }
  if (connection.client.ready != 0) read(connection.up, connection.client, now_ns);
  if (connection.target.ready != 0) read(connection.down, connection.target, now_ns);
  if (!connection.is_connecting)
    write(connection, connection.up, connection.target, RelayDirection::up, now_ns);
  write(connection, connection.down, connection.client, RelayDirection::down, now_ns);
  if (connection.up.told && connection.down.told) connection.is_over = true;
}

void FaultProxy::Relay::read(Flow& flow, const End& from, std::int64_t now_ns) {
  for (;;) {
    const std::size_t room = std::min(flow.channel.room(now_.how), buffer_.size());
    if (flow.ended || room == 0) return;
    const ssize_t got = ::recv(from.socket.get(), buffer_.data(), room, 0);
    if (got < 0 && would_block(errno)) return;
    if (got <= 0) {
      flow.ended = true;
      flow.reset = got < 0;
      return;
    }
    flow.channel.put(now_ns, now_.how, std::span(buffer_).first(static_cast<std::size_t>(got)));
  }
}

void FaultProxy::Relay::write(RelayedConnection& connection, Flow& flow, const End& to,
                              RelayDirection way, std::int64_t now_ns) {
  if (connection.is_over || now_ns < stalled_until_ns(way)) return;
  flow.is_blocked = false;
  for (auto piece = flow.channel.due(now_ns); !piece.empty(); piece = flow.channel.due(now_ns)) {
    const ssize_t took = ::send(to.socket.get(), piece.data(), piece.size(), MSG_NOSIGNAL);
    if (took < 0 && !would_block(errno)) return connection.end_by_reset();
    if (took < 0) {
      flow.is_blocked = true;
      return;
    }
    (way == RelayDirection::up ? done_.up_bytes : done_.down_bytes) +=
        static_cast<std::uint64_t>(took);
    flow.channel.took(static_cast<std::size_t>(took));
  }
  if (!flow.ended || flow.told || flow.channel.held() != 0) return;
  flow.told = true;
  if (flow.reset) return connection.end_by_reset();
  static_cast<void>(::shutdown(to.socket.get(), SHUT_WR));
}

void FaultProxy::Relay::wait() {
  std::int64_t wake_ns = std::min(next_stall_ns_, next_cut_ns_);
  if (accept_at_ns_ != INT64_MIN) wake_ns = std::min(wake_ns, accept_at_ns_);
  const bool accepts = connections_.size() < kConnections && accept_at_ns_ == INT64_MIN;
  polled_.assign({{event_.get(), POLLIN, 0}, {accepts ? listener_.get() : -1, POLLIN, 0}});
  const auto interest = [&](const End& end, const Flow& from, const Flow& to, RelayDirection way) {
    short events = 0;
    if (!from.ended && from.channel.room(now_.how) != 0) events |= POLLIN;
    if (to.is_blocked) {
      events |= POLLOUT;
    } else {
      const bool must_tell = to.ended && !to.told && to.channel.held() == 0;
      const std::int64_t due_ns = must_tell ? INT64_MIN : to.channel.due_ns();
      wake_ns = std::min(wake_ns, std::max(due_ns, stalled_until_ns(way)));
    }
    // Without an interest the system would still tell of the end of the connection, again and
    // again.
    polled_.push_back({events == 0 ? -1 : end.socket.get(), events, 0});
  };
  for (const RelayedConnection& connection : connections_) {
    interest(connection.client, connection.up, connection.down, RelayDirection::down);
    if (connection.is_connecting) {
      polled_.push_back({connection.target.socket.get(), POLLOUT, 0});
    } else {
      interest(connection.target, connection.down, connection.up, RelayDirection::up);
    }
  }
  const std::int64_t left_ns = std::max<std::int64_t>(0, wake_ns - steady_now_ns());
  const timespec timeout{static_cast<time_t>(left_ns / 1'000'000'000), left_ns % 1'000'000'000};
  ::ppoll(polled_.data(), polled_.size(), wake_ns == kNever ? nullptr : &timeout, nullptr);
  eventfd_t ignored = 0;
  static_cast<void>(::eventfd_read(event_.get(), &ignored));
  std::size_t next = 2;
  for (RelayedConnection& connection : connections_) {
    connection.client.ready = polled_[next++].revents;
    connection.target.ready = polled_[next++].revents;
  }
}

Result<std::unique_ptr<FaultProxy>> FaultProxy::open(const net::Address& listen,
                                                     const net::Address& target,
                                                     const Impairment& how, std::uint64_t seed) {
  const auto at = find(listen);
  if (!at) return at.error();
  auto to = find(target);
  if (!to) return to.error();
  Descriptor listener(open_socket(*at));
  const int on = 1;
  static_cast<void>(::setsockopt(listener.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on));
  if (::bind(listener.get(), get(*at), size_of(*at)) != 0 ||
      ::listen(listener.get(), kBacklog) != 0) {
    return Error{"cannot listen on " + listen.url() + ": " + system_text(errno)};
  }
  const net::Address address = bound(listen, listener.get());
  auto relay = std::make_unique<Relay>(listener.release(), address, std::move(*to), how, seed);
  return std::unique_ptr<FaultProxy>(new FaultProxy(std::move(relay)));
}

FaultProxy::FaultProxy(std::unique_ptr<Relay> relay) : relay_(std::move(relay)) {}
FaultProxy::~FaultProxy() = default;

const std::string& FaultProxy::url() const { return relay_->url(); }
Impairment FaultProxy::impairment() const { return relay_->orders().how; }
Relayed FaultProxy::relayed() const { return relay_->relayed(); }

void FaultProxy::change(const Impairment& how) {
  relay_->order([&](Relay::Orders& orders) { orders.how = how; });
}

void FaultProxy::stall(RelayDirection way, std::int64_t duration_ns) {
  const std::int64_t now_ns = steady_now_ns();
  const std::int64_t end_ns = duration_ns > kNever - now_ns ? kNever : now_ns + duration_ns;
  relay_->order([&](Relay::Orders& orders) {
    if (way != RelayDirection::down) orders.stalled_until_ns[0] = end_ns;
    if (way != RelayDirection::up) orders.stalled_until_ns[1] = end_ns;
  });
}

void FaultProxy::go() {
  relay_->order([](Relay::Orders& orders) { orders.stalled_until_ns.fill(INT64_MIN); });
}

void FaultProxy::cut() {
  relay_->order([](Relay::Orders& orders) { ++orders.cuts; });
}

void FaultProxy::refuse(bool all) {
  relay_->order([&](Relay::Orders& orders) { orders.refuses = all; });
}

}  // namespace gimnet::impair
