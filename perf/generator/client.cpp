#include "generator/client.hpp"

#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>

namespace gimnet::perf {

Client::~Client() { close(); }

void Client::close() {
  if (socket_ >= 0) ::close(socket_);
  socket_ = -1;
}

bool Client::send_some(std::span<const std::byte>& bytes) {
  const ssize_t sent = ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
  if (sent < 0) {
    if (errno != EAGAIN && errno != EINTR) is_closed = true;
    return false;
  }
  bytes = bytes.subspan(static_cast<std::size_t>(sent));
  return bytes.empty();
}

bool Client::flush() {
  if (is_closed) return false;
  if (!begun_.empty() && !send_some(begun_)) return false;
  if (control_.empty()) return true;
  std::span<const std::byte> rest = std::span<const std::byte>(control_).subspan(control_sent_);
  const bool all = send_some(rest);
  control_sent_ = control_.size() - rest.size();
  if (!all) return false;
  control_.clear();
  control_sent_ = 0;
  return true;
}

bool Client::write(std::span<const std::byte> bytes) {
  begun_ = bytes;
  return send_some(begun_);
}

void Client::write_control(std::span<const std::byte> bytes) {
  control_.insert(control_.end(), bytes.begin(), bytes.end());
  flush();
}

}  // namespace gimnet::perf
