#include "hub/transport/socket_transport.hpp"

#include <fcntl.h>
#include <linux/sockios.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "base/check.hpp"

namespace gimnet::hub {
namespace {

constexpr std::uint32_t kUnsentLeast = 4'096;

// A socket that refuses an option still works: what these set is speed, not meaning.
void set_option(int descriptor, int level, int name, int value) {
  static_cast<void>(::setsockopt(descriptor, level, name, &value, sizeof value));
}

IoResult failed_call() {
  if (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR || errno == ENOBUFS) {
    return {IoStatus::would_block, 0};
  }
  return {IoStatus::failed, 0};
}

}  // namespace

SocketTransport::SocketTransport(int descriptor, Family family, const Limits& limits)
    : descriptor_(descriptor),
      family_(family),
      send_buffer_bytes_(static_cast<int>(limits.socket_send_bytes)) {
  GIMNET_CHECK(descriptor >= 0);
  static_cast<void>(::fcntl(descriptor, F_SETFL, ::fcntl(descriptor, F_GETFL) | O_NONBLOCK));
  if (family == Family::tcp) set_option(descriptor, IPPROTO_TCP, TCP_NODELAY, 1);
  set_option(descriptor, SOL_SOCKET, SO_SNDBUF, send_buffer_bytes_);
}

SocketTransport::~SocketTransport() { ::close(descriptor_); }

IoResult SocketTransport::receive(std::span<std::byte> into) {
  GIMNET_ASSERT(!into.empty());
  const ssize_t count = ::recv(descriptor_, into.data(), into.size(), MSG_DONTWAIT);
  if (count > 0) return {IoStatus::ok, static_cast<std::size_t>(count)};
  if (count == 0) return {IoStatus::closed, 0};
  return failed_call();
}

IoResult SocketTransport::send(std::span<const iovec> pieces) {
  GIMNET_ASSERT(!pieces.empty());
  ssize_t count = 0;
  if (pieces.size() == 1) {
    count = ::send(descriptor_, pieces[0].iov_base, pieces[0].iov_len, MSG_DONTWAIT | MSG_NOSIGNAL);
  } else {
    msghdr message{};
    message.msg_iov = const_cast<iovec*>(pieces.data());  // sendmsg() only reads them
    message.msg_iovlen = pieces.size();
    count = ::sendmsg(descriptor_, &message, MSG_DONTWAIT | MSG_NOSIGNAL);
  }
  if (count > 0) return {IoStatus::ok, static_cast<std::size_t>(count)};
  if (count == 0) return {IoStatus::would_block, 0};
  return failed_call();
}

std::uint64_t SocketTransport::unsent_bytes() const {
  int bytes = 0;
  if (::ioctl(descriptor_, SIOCOUTQ, &bytes) != 0 || bytes < 0) return 0;
  return static_cast<std::uint64_t>(bytes);
}

void SocketTransport::limit_unsent(std::uint32_t bytes) {
  const auto wanted = bytes == 0 ? 0 : static_cast<int>(std::clamp(bytes, kUnsentLeast, 1u << 30));
  if (family_ == Family::tcp) {
    // 0 is the system's own value: no bound.
    set_option(descriptor_, IPPROTO_TCP, TCP_NOTSENT_LOWAT, wanted);
  } else {
    // A Unix socket has no mark for what is unsent, but its send buffer is all there is between the
    // two ends. The bound is on top of the buffer's own, and never raises it.
    set_option(descriptor_, SOL_SOCKET, SO_SNDBUF,
               bytes == 0 ? send_buffer_bytes_ : std::min(wanted, send_buffer_bytes_));
  }
}

void SocketTransport::limit_unacknowledged(std::uint32_t ms) {
  if (family_ == Family::tcp)
    set_option(descriptor_, IPPROTO_TCP, TCP_USER_TIMEOUT, static_cast<int>(ms));
}

}  // namespace gimnet::hub
