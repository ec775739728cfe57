#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <pthread.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <mutex>
#include <system_error>

#include "base/runtime_folder.hpp"
#include "client/nif/endpoint.hpp"
#include "client/nif/host_lookup.hpp"
#include "client/nif/platform.hpp"

namespace gimnet::nif {
namespace {

/// Milliseconds for poll(), rounded up so that a wait never ends before its deadline.
int poll_timeout_ms(Deadline deadline) {
  if (deadline == kNever) return -1;
  const std::int64_t left_ns = deadline - steady_now_ns();
  if (left_ns <= 0) return 0;
  return static_cast<int>(std::min<std::int64_t>((left_ns + kNsPerMs - 1) / kNsPerMs, 60'000));
}

void set_option(Descriptor descriptor, int level, int name, int value) {
  // Each of these only tunes: where the system refuses, the connection works without.
  static_cast<void>(::setsockopt(descriptor, level, name, &value, sizeof value));
}

void set_options(Descriptor descriptor, const SocketOptions& options) {
  if (options.receive_bytes != 0)
    set_option(descriptor, SOL_SOCKET, SO_RCVBUF, static_cast<int>(options.receive_bytes));
  if (options.send_bytes != 0)
    set_option(descriptor, SOL_SOCKET, SO_SNDBUF, static_cast<int>(options.send_bytes));
}

Failure cannot_connect(const Endpoint& endpoint, int error) {
  nif_status status = NIF_NO_HUB;
  if (error == EMFILE || error == ENFILE || error == ENOMEM || error == ENOBUFS)
    status = NIF_NO_MEMORY;
  if (error == EACCES || error == EPERM) status = NIF_SYSTEM;
  std::string remedy = status == NIF_NO_HUB ? "; is the hub running there?" : "";
  if (error == EACCES && endpoint.transport == Endpoint::Transport::unix_socket) {
    remedy = "; it is another user's: connect as the user that runs the hub, or over TCP";
  }
  struct stat info{};
  if (endpoint.transport == Endpoint::Transport::unix_socket &&
      ::stat(endpoint.path.c_str(), &info) == 0 && S_ISDIR(info.st_mode)) {
    const std::string folder = endpoint.path.substr(0, endpoint.path.find_last_not_of('/') + 1);
    return {NIF_BAD_ARGUMENT, "cannot connect to " + endpoint.url() +
                                  ": it is a folder; name the hub's socket in it, as in unix:" +
                                  folder + "/tcphub.sock"};
  }
  return {status, "cannot connect to " + endpoint.url() + ": " + system_error_text(error) + remedy,
          error == ECONNREFUSED || error == ENOENT};
}

/// Waits for a connect() under way. Nothing: connected.
Result<Socket, Failure> finish_dial(Socket socket, const Endpoint& endpoint, Deadline deadline,
                                    const WakeSignal& cancel) {
  for (;;) {
    const Ready ready = wait_for(socket, false, true, cancel, deadline);
    if (ready.woken) return Failure{NIF_CLOSED, "closed while connecting to " + endpoint.url()};
    if (ready.writable || ready.readable) break;
    if (steady_now_ns() >= deadline) {
      return Failure{NIF_TIMEOUT, "no connection to " + endpoint.url() + " within the time given"};
    }
  }
  int error = 0;
  socklen_t size = sizeof error;
  if (::getsockopt(socket.descriptor(), SOL_SOCKET, SO_ERROR, &error, &size) != 0) error = errno;
  if (error != 0) return cannot_connect(endpoint, error);
  return socket;
}

Result<Socket, Failure> dial_address(const sockaddr* address, socklen_t address_size,
                                     const Endpoint& endpoint, const SocketOptions& options,
                                     Deadline deadline, const WakeSignal& cancel) {
  Socket socket(::socket(address->sa_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!socket.open()) return cannot_connect(endpoint, errno);
  set_options(socket.descriptor(), options);
  if (endpoint.transport == Endpoint::Transport::tcp)
    set_option(socket.descriptor(), IPPROTO_TCP, TCP_NODELAY, 1);
  if (::connect(socket.descriptor(), address, address_size) == 0) return socket;
  if (errno != EINPROGRESS && errno != EINTR) return cannot_connect(endpoint, errno);
  return finish_dial(std::move(socket), endpoint, deadline, cancel);
}

Result<Socket, Failure> dial_unix(const Endpoint& endpoint, const SocketOptions& options,
                                  Deadline deadline, const WakeSignal& cancel) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path, endpoint.path.data(),
              std::min(endpoint.path.size(), unix_path_max()));
  return dial_address(reinterpret_cast<const sockaddr*>(&address), sizeof address, endpoint,
                      options, deadline, cancel);
}

Result<Socket, Failure> dial_tcp(const Endpoint& endpoint, const SocketOptions& options,
                                 Deadline deadline, const WakeSignal& cancel) {
  const auto addresses = find_addresses(endpoint, deadline, cancel);
  if (!addresses) return addresses.error();
  Failure last;
  for (const HostAddress& address : *addresses) {
    auto dialed =
        dial_address(reinterpret_cast<const sockaddr*>(address.data()),
                     static_cast<socklen_t>(address.size()), endpoint, options, deadline, cancel);
    if (dialed || dialed.error().status == NIF_CLOSED) return dialed;
    last = dialed.error();
  }
  return last;
}

/// The folder is there, belongs to this user, and is closed to everybody else.
bool is_own_folder(const std::string& path) {
  struct stat info{};
  return ::lstat(path.c_str(), &info) == 0 && S_ISDIR(info.st_mode) && info.st_uid == ::geteuid() &&
         (info.st_mode & (S_IRWXG | S_IRWXO)) == 0;
}

constinit std::atomic<std::uint32_t> g_fork_generation{0};

}  // namespace

WakeSignal::WakeSignal() : descriptor_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}

WakeSignal::~WakeSignal() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

void WakeSignal::raise() {
  const std::uint64_t one = 1;
  // Fails only where the counter is full: then it is raised already.
  static_cast<void>(!::write(descriptor_, &one, sizeof one));
}

void WakeSignal::clear() {
  std::uint64_t count = 0;
  static_cast<void>(!::read(descriptor_, &count, sizeof count));
}

IoResult Socket::write(std::span<const std::span<const std::byte>> pieces) {
  std::array<iovec, kWritePiecesMax> vectors;
  const std::size_t count = std::min(pieces.size(), kWritePiecesMax);
  for (std::size_t i = 0; i < count; ++i) {
    vectors[i] = {const_cast<std::byte*>(pieces[i].data()), pieces[i].size()};
  }
  msghdr message{};
  message.msg_iov = vectors.data();
  message.msg_iovlen = count;
  constexpr int kFlags = MSG_NOSIGNAL | MSG_DONTWAIT;
  for (;;) {
    // One piece, as of most messages that go by themselves, costs 75 ns less without a vector.
    const ssize_t written = count == 1
                                ? ::send(descriptor_, pieces[0].data(), pieces[0].size(), kFlags)
                                : ::sendmsg(descriptor_, &message, kFlags);
    if (written >= 0) return {IoResult::State::done, static_cast<std::size_t>(written), 0};
    if (errno == EINTR) continue;
    if (errno == EAGAIN || errno == EWOULDBLOCK || errno == ENOBUFS)
      return {IoResult::State::would_block, 0, 0};
    return {IoResult::State::failed, 0, errno};
  }
}

IoResult Socket::read(std::span<std::byte> memory) {
  for (;;) {
    const ssize_t received = ::recv(descriptor_, memory.data(), memory.size(), MSG_DONTWAIT);
    if (received > 0) return {IoResult::State::done, static_cast<std::size_t>(received), 0};
    if (received == 0) return {IoResult::State::ended, 0, 0};
    if (errno == EINTR) continue;
    if (errno == EAGAIN || errno == EWOULDBLOCK) return {IoResult::State::would_block, 0, 0};
    return {IoResult::State::failed, 0, errno};
  }
}

void Socket::shutdown_write() { static_cast<void>(::shutdown(descriptor_, SHUT_WR)); }

void Socket::close() {
  if (descriptor_ >= 0) ::close(std::exchange(descriptor_, -1));
}

Result<Socket, Failure> dial(const Endpoint& endpoint, const SocketOptions& options,
                             Deadline deadline, const WakeSignal& cancel) {
  return endpoint.transport == Endpoint::Transport::unix_socket
             ? dial_unix(endpoint, options, deadline, cancel)
             : dial_tcp(endpoint, options, deadline, cancel);
}

Ready wait_for(const Socket& socket, bool read, bool write, const WakeSignal& wake,
               Deadline deadline) {
  const auto events = static_cast<short>((read ? POLLIN : 0) | (write ? POLLOUT : 0));
  // A negative descriptor is skipped: with nothing asked of the socket even its errors must not end
  // the wait at once.
  std::array<pollfd, 2> waits{
      {{wake.descriptor(), POLLIN, 0}, {events != 0 ? socket.descriptor() : -1, events, 0}}};
  const int count = ::poll(waits.data(), waits.size(), poll_timeout_ms(deadline));
  if (count <= 0) return {};
  Ready ready;
  ready.woken = waits[0].revents != 0;
  const bool broken = (waits[1].revents & (POLLERR | POLLHUP | POLLNVAL)) != 0;
  ready.readable = (waits[1].revents & POLLIN) != 0 || (broken && read);
  ready.writable = (waits[1].revents & POLLOUT) != 0 || (broken && write);
  return ready;
}

Raised wait_for_either(const WakeSignal& one, const WakeSignal& other, Deadline deadline) {
  std::array<pollfd, 2> waits{{{one.descriptor(), POLLIN, 0}, {other.descriptor(), POLLIN, 0}}};
  if (::poll(waits.data(), waits.size(), poll_timeout_ms(deadline)) <= 0) return {};
  return {waits[0].revents != 0, waits[1].revents != 0};
}

std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value != nullptr ? value : "";
}

std::string runtime_folder() {
  const RuntimeFolder folder = runtime_folder_of_user();
  // XDG_RUNTIME_DIR is nobody else's already. Its owner may have given the folder in it to a
  // container, in which the same user has another id.
  return folder.in_private || is_own_folder(folder.path()) ? folder.path() : "";
}

std::size_t unix_path_max() { return sizeof(sockaddr_un::sun_path) - 1; }

struct SignalsBlocked::Saved {
  sigset_t set;
};

SignalsBlocked::SignalsBlocked() : saved_(std::make_unique<Saved>()) {
  sigset_t all;
  ::sigfillset(&all);
  ::pthread_sigmask(SIG_SETMASK, &all, &saved_->set);
}

SignalsBlocked::~SignalsBlocked() { ::pthread_sigmask(SIG_SETMASK, &saved_->set, nullptr); }

std::uint32_t fork_generation() {
  static std::once_flag once;
  std::call_once(once, [] {
    static_cast<void>(::pthread_atfork(nullptr, nullptr, [] { g_fork_generation.fetch_add(1); }));
  });
  return g_fork_generation.load(
      std::memory_order_relaxed);  // partner: fetch_add in the child, which has one thread
}

std::string system_error_text(int error) { return std::generic_category().message(error); }

}  // namespace gimnet::nif
