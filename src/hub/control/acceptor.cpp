#include "hub/control/acceptor.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>

#include "base/log.hpp"
#include "hub/control/goodbye.hpp"
#include "hub/control/log_peer.hpp"
#include "hub/transport/socket_transport.hpp"

namespace gimnet::hub {
namespace {

constexpr int kBatch = 64;

int accept_one(int listener) { return ::accept4(listener, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK); }

int open_spare() { return ::open("/dev/null", O_RDONLY | O_CLOEXEC); }

std::string tcp_peer(int descriptor) {
  sockaddr_storage storage{};
  socklen_t size = sizeof storage;
  std::array<char, INET6_ADDRSTRLEN> text{};
  if (::getpeername(descriptor, reinterpret_cast<sockaddr*>(&storage), &size) != 0) return "unknown";
  if (storage.ss_family == AF_INET6) {
    const auto* v6 = reinterpret_cast<const sockaddr_in6*>(&storage);
    ::inet_ntop(AF_INET6, &v6->sin6_addr, text.data(), text.size());
    return "[" + std::string{text.data()} + "]:" + std::to_string(ntohs(v6->sin6_port));
  }
  const auto* v4 = reinterpret_cast<const sockaddr_in*>(&storage);
  ::inet_ntop(AF_INET, &v4->sin_addr, text.data(), text.size());
  return std::string{text.data()} + ":" + std::to_string(ntohs(v4->sin_port));
}

bool is_shortage(int error) { return error == EMFILE || error == ENFILE || error == ENOBUFS || error == ENOMEM; }

}  // namespace

Acceptor::Acceptor(std::unique_ptr<Listener> listener, const Limits& limits, RefusalCounters& refusals)
    : listener_(std::move(listener)), limits_(limits), refusals_(refusals), spare_(open_spare()) {}

Acceptor::~Acceptor() {
  if (spare_ >= 0) ::close(spare_);
}

Acceptor::After Acceptor::accept_some(const std::function<void(Stranger)>& take) {
  for (int i = 0; i < kBatch; ++i) {
    const int descriptor = accept_one(listener_->descriptor());
    if (descriptor >= 0) {
      take(stranger(descriptor));
    } else if (errno == EAGAIN || errno == EWOULDBLOCK) {
      return After::wait;
    } else if (is_shortage(errno)) {
      // The kernel says so before it looks whether anybody waits.
      const Shortage outcome = turn_away();
      if (outcome != Shortage::told_one) return outcome == Shortage::nobody_waits ? After::wait : After::pause;
    }
    // Anything else is one peer's trouble (it reset before it was accepted): the next one may be well.
  }
  return After::wait;
}

Stranger Acceptor::stranger(int descriptor) const {
  Stranger result;
  if (listener_->url().scheme == ListenUrl::Scheme::tcp) {
    result.peer = PeerInfo{"tcp", tcp_peer(descriptor)};
    result.identity = "open";
    result.transport = std::make_unique<SocketTransport>(descriptor, SocketTransport::Family::tcp, limits_);
    return result;
  }
  ucred credentials{};
  socklen_t size = sizeof credentials;
  result.peer = PeerInfo{"unix", "unknown"};
  result.identity = "unknown";
  if (::getsockopt(descriptor, SOL_SOCKET, SO_PEERCRED, &credentials, &size) == 0) {
    result.peer.address = "pid " + std::to_string(credentials.pid) + " uid " + std::to_string(credentials.uid);
    result.identity = "uid " + std::to_string(credentials.uid);
    result.may_administer = credentials.uid == 0 || credentials.uid == ::geteuid();
  }
  result.transport = std::make_unique<SocketTransport>(descriptor, SocketTransport::Family::unix_socket, limits_);
  return result;
}

Acceptor::Shortage Acceptor::turn_away() {
  if (spare_ < 0) spare_ = open_spare();
  if (spare_ < 0) return Shortage::nothing_helps;
  ::close(spare_);
  const int descriptor = accept_one(listener_->descriptor());
  const int error = errno;
  if (descriptor >= 0) {
    refusals_.no_descriptor.add(1);
    Stranger unlucky = stranger(descriptor);
    log_line(LogLevel::error, {"no_descriptor", log_peer(unlucky.peer.transport, unlucky.peer.address)},
             "out of descriptors: turned " + unlucky.peer.transport + " " + unlucky.peer.address +
                 " away; raise the limit (ulimit -n) or lower --limit nodes");
    static_cast<void>(send_goodbye(*unlucky.transport, proto::GoodbyeCode::no_memory,
                                   "the hub is out of descriptors; try again later"));
  }
  spare_ = open_spare();
  if (descriptor >= 0) return Shortage::told_one;
  return error == EAGAIN || error == EWOULDBLOCK ? Shortage::nobody_waits : Shortage::nothing_helps;
}

}  // namespace gimnet::hub
