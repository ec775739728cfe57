#include "hub/control/acceptor.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>

#include "base/log.hpp"
#include "hub/control/log_peer.hpp"
#include "hub/shard/control_frame.hpp"

namespace gimnet::hub {

int open_spare_descriptor() { return ::open("/dev/null", O_RDONLY | O_CLOEXEC); }

DescriptorReserve::DescriptorReserve(const Limits& limits) : limits_(limits) { fill(); }

DescriptorReserve::~DescriptorReserve() {
  for (const int descriptor : kept_) ::close(descriptor);
}

void DescriptorReserve::fill() {
  while (kept_.size() > limits_.administrators) static_cast<void>(give_up_one());
  while (kept_.size() < limits_.administrators) {
    const int descriptor = open_spare_descriptor();
    if (descriptor < 0) return;
    kept_.push_back(descriptor);
  }
}

bool DescriptorReserve::give_up_one() {
  if (kept_.empty()) return false;
  ::close(kept_.back());
  kept_.pop_back();
  return true;
}

namespace {

constexpr int kBatch = 64;

int accept_one(int listener) {
  return ::accept4(listener, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
}

std::string tcp_peer(int descriptor) {
  sockaddr_storage storage{};
  socklen_t size = sizeof storage;
  std::array<char, INET6_ADDRSTRLEN> text{};
  if (::getpeername(descriptor, reinterpret_cast<sockaddr*>(&storage), &size) != 0)
    return "unknown";
  if (storage.ss_family == AF_INET6) {
    const auto* v6 = reinterpret_cast<const sockaddr_in6*>(&storage);
    ::inet_ntop(AF_INET6, &v6->sin6_addr, text.data(), text.size());
    return "[" + std::string{text.data()} + "]:" + std::to_string(ntohs(v6->sin6_port));
  }
  const auto* v4 = reinterpret_cast<const sockaddr_in*>(&storage);
  ::inet_ntop(AF_INET, &v4->sin_addr, text.data(), text.size());
  return std::string{text.data()} + ":" + std::to_string(ntohs(v4->sin_port));
}

bool is_shortage(int error) {
  return error == EMFILE || error == ENFILE || error == ENOBUFS || error == ENOMEM;
}

}  // namespace

Acceptor::Acceptor(std::unique_ptr<Listener> listener, const Limits& limits,
                   RefusalCounters& refusals, DescriptorReserve& reserve, MakeRoom make_room)
    : listener_(std::move(listener)),
      limits_(limits),
      refusals_(refusals),
      reserve_(reserve),
      make_room_(std::move(make_room)),
      spare_(open_spare_descriptor()) {}

Acceptor::~Acceptor() {
  if (spare_ >= 0) ::close(spare_);
}

Acceptor::After Acceptor::accept_some(const std::function<void(Stranger)>& take) {
  reserve_.fill();
  for (int i = 0; i < kBatch; ++i) {
    const int descriptor = accept_one(listener_->descriptor());
    if (descriptor >= 0) {
      take(stranger(descriptor));
    } else if (errno == EAGAIN || errno == EWOULDBLOCK) {
      return After::wait;
    } else if (is_shortage(errno)) {
      // The kernel says so before it looks whether anybody waits.
      const Shortage outcome = accept_with_spare(take);
      if (outcome != Shortage::served_one)
        return outcome == Shortage::nobody_waits ? After::wait : After::pause;
    }
    // Anything else is one peer's trouble (it reset before it was accepted): the next one may be
    // well.
  }
  return After::wait;
}

std::unique_ptr<net::Stream> Acceptor::stream_of(int descriptor,
                                                 net::SocketStream::Family family) const {
  const auto send_bytes = static_cast<std::uint32_t>(limits_.socket_send_bytes);
  return net::make_stream(descriptor, family, net::SocketOptions{.send_bytes = send_bytes});
}

Stranger Acceptor::stranger(int descriptor) const {
  Stranger result;
  if (listener_->url().scheme == ListenUrl::Scheme::tcp) {
    result.peer = PeerInfo{"tcp", tcp_peer(descriptor)};
    result.identity = Identity::open();
    result.transport = stream_of(descriptor, net::SocketStream::Family::tcp);
    return result;
  }
  ucred credentials{};
  socklen_t size = sizeof credentials;
  result.peer = PeerInfo{"unix", "unknown"};
  if (::getsockopt(descriptor, SOL_SOCKET, SO_PEERCRED, &credentials, &size) == 0) {
    result.peer.address =
        "pid " + std::to_string(credentials.pid) + " uid " + std::to_string(credentials.uid);
    result.identity = Identity::of_user(credentials.uid);
    result.rights.administer = credentials.uid == 0 || credentials.uid == ::geteuid();
  }
  result.transport = stream_of(descriptor, net::SocketStream::Family::unix_socket);
  return result;
}

Acceptor::Shortage Acceptor::accept_with_spare(const std::function<void(Stranger)>& take) {
  if (spare_ < 0) spare_ = open_spare_descriptor();
  if (spare_ < 0) return Shortage::nothing_helps;
  ::close(spare_);
  const int descriptor = accept_one(listener_->descriptor());
  const int error = errno;
  if (descriptor < 0) {
    spare_ = open_spare_descriptor();
    return error == EAGAIN || error == EWOULDBLOCK ? Shortage::nobody_waits
                                                   : Shortage::nothing_helps;
  }
  Stranger peer = stranger(descriptor);
  if (find_room(peer)) {
    spare_ = open_spare_descriptor();
    take(std::move(peer));
  } else {
    turn_away(peer);
    peer.transport.reset();
    spare_ = open_spare_descriptor();
  }
  return Shortage::served_one;
}

bool Acceptor::find_room(Stranger& peer) {
  Room room = make_room_(peer);
  if (room == Room::none && peer.rights.administer && reserve_.give_up_one()) room = Room::reserved;
  peer.on_reserve = room == Room::reserved;
  return room != Room::none;
}

void Acceptor::turn_away(const Stranger& peer) {
  refusals_.no_descriptor.add(1);
  log_line(LogLevel::error, {"no_descriptor", log_peer(peer.peer.transport, peer.peer.address)},
           "out of descriptors: turned " + peer.peer.transport + " " + peer.peer.address +
               " away; raise the limit (ulimit -n) or lower --limit nodes");
  static_cast<void>(send_goodbye(*peer.transport, proto::GoodbyeCode::no_memory,
                                 "the hub is out of descriptors; try again later"));
}

bool send_goodbye(net::Stream& transport, proto::GoodbyeCode code, std::string_view sentence) {
  const std::vector<std::byte> frame =
      control_frame(proto::Kind::link, NodeId{0}, kOwnHub,
                    proto::encode(proto::Goodbye{code, std::string{sentence}}));
  const std::array<iovec, 2> pieces{
      iovec{const_cast<std::byte*>(proto::kOpening.data()), proto::kOpening.size()},
      iovec{const_cast<std::byte*>(frame.data()), frame.size()}};  // send() only reads them
  return transport.send(pieces).status == net::IoStatus::ok;
}

}  // namespace gimnet::hub
