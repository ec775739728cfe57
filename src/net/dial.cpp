#include "net/dial.hpp"

#include <sys/socket.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <functional>
#include <optional>
#include <string>
#include <utility>

#include "base/descriptor.hpp"
#include "net/dial_handshake.hpp"
#include "net/host_lookup.hpp"
#include "net/proxy_handshake.hpp"

namespace gimnet::net {
namespace {

using StreamPointer = std::unique_ptr<Stream>;

bool is_unix(const Address& address) { return address.scheme == Address::Scheme::unix_socket; }

/// A place to connect to, and what there should be.
struct DialTarget {
  const Address& address;
  const char* what;
};

NetError cannot_connect(const DialTarget& target, int error) {
  const Address& address = target.address;
  Fault fault = Fault::no_peer;
  if (error == EMFILE || error == ENFILE || error == ENOMEM || error == ENOBUFS)
    fault = Fault::no_memory;
  if (error == EACCES || error == EPERM) fault = Fault::not_permitted;
  std::string remedy =
      fault == Fault::no_peer ? "; is the " + std::string(target.what) + " running there?" : "";
  if (error == EACCES && is_unix(address)) {
    remedy = "; it is another user's: connect as the user that runs the hub, or over TCP";
  }
  struct stat info{};
  if (is_unix(address) && ::stat(address.path.c_str(), &info) == 0 && S_ISDIR(info.st_mode)) {
    const std::string folder = address.path.substr(0, address.path.find_last_not_of('/') + 1);
    return {Fault::bad_address, "cannot connect to " + address.url() +
                                    ": it is a folder; name the hub's socket in it, as in unix:" +
                                    folder + "/tcphub.sock"};
  }
  NetError failed(fault, "cannot connect to " + address.url() + ": " + system_text(error) + remedy);
  failed.nobody_listens = error == ECONNREFUSED || error == ENOENT;
  return failed;
}

NetError cancelled(const Address& address) {
  return {Fault::cancelled, "closed while connecting to " + address.url()};
}

NetError closed_early(const Address& address) {
  return {Fault::no_peer, "the peer at " + address.url() +
                              " closed the connection before it said WELCOME; is it a hub?"};
}

/// Waits for a connect() under way.
Result<StreamPointer, NetError> finish_dial(StreamPointer stream, const DialTarget& target,
                                            Deadline deadline, const WakeSignal& cancel) {
  for (;;) {
    const Readiness ready = wait_for(stream.get(), {.write = true}, cancel, deadline);
    if (ready.woken) return cancelled(target.address);
    if (ready.writable) break;
    if (steady_now_ns() >= deadline) {
      return NetError{Fault::timeout,
                      "no connection to " + target.address.url() + " within the time given"};
    }
  }
  int error = 0;
  socklen_t size = sizeof error;
  if (::getsockopt(stream->descriptor(), SOL_SOCKET, SO_ERROR, &error, &size) != 0) error = errno;
  if (error != 0) return cannot_connect(target, error);
  return stream;
}

Result<StreamPointer, NetError> dial_one(const sockaddr* to, socklen_t size,
                                         const DialTarget& target, const SocketOptions& options,
                                         Deadline deadline, const WakeSignal& cancel) {
  const int descriptor = ::socket(to->sa_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (descriptor < 0) return cannot_connect(target, errno);
  StreamPointer stream = make_stream(
      descriptor,
      is_unix(target.address) ? SocketStream::Family::unix_socket : SocketStream::Family::tcp,
      options);
  if (::connect(descriptor, to, size) == 0) return stream;
  if (errno != EINPROGRESS && errno != EINTR) return cannot_connect(target, errno);
  return finish_dial(std::move(stream), target, deadline, cancel);
}

/// Nothing: all is written.
std::optional<NetError> write_all(Stream& stream, std::span<const std::byte> bytes,
                                  const Address& address, Deadline deadline,
                                  const WakeSignal& cancel) {
  while (!bytes.empty() || stream.pending_out() != 0) {
    const iovec piece{const_cast<std::byte*>(bytes.data()), bytes.size()};
    const IoResult result = stream.send({&piece, bytes.empty() ? 0u : 1u});
    bytes = bytes.subspan(result.bytes);
    if (result.status == IoStatus::failed) return closed_early(address);
    if (result.status != IoStatus::would_block && stream.pending_out() == 0) continue;
    const Readiness ready = wait_for(&stream, {.write = true}, cancel, deadline);
    if (ready.woken) return cancelled(address);
    if (!ready.writable && steady_now_ns() >= deadline) {
      return NetError{Fault::timeout, "the peer at " + address.url() + " takes no bytes"};
    }
  }
  return std::nullopt;
}

NetError refused(const proto::Goodbye& goodbye, const Address& address) {
  const std::string reason =
      goodbye.sentence.empty() ? std::string(proto::goodbye_name(goodbye.code)) : goodbye.sentence;
  NetError error(Fault::refused, "the hub at " + address.url() + " refused: " + reason);
  error.goodbye = goodbye.code;
  return error;
}

/// Takes what came, and gives the bytes that are still missing at least; 0: that is all.
using Take = std::function<std::size_t(std::span<const std::byte>)>;

/// The errors for a peer that ends, and for one that does not answer in time.
struct Silences {
  NetError closed;
  NetError late;
};

/// Reads `missing` bytes at most, and then as many as `take` says, until it has all.
std::optional<NetError> read_answer(Stream& stream, std::size_t missing, const Take& take,
                                    const Address& address, const Silences& silences,
                                    Deadline deadline, const WakeSignal& cancel) {
  std::array<std::byte, 4096> memory;
  while (missing != 0) {
    const std::size_t most = std::min(memory.size(), missing);
    const IoResult result = stream.receive(std::span(memory).first(most));
    if (result.status == IoStatus::closed || result.status == IoStatus::failed)
      return silences.closed;
    if (result.status == IoStatus::ok) {
      missing = take(std::span(memory).first(result.bytes));
      continue;
    }
    const Interest interest = interest_of(true, false, stream.pending_out());
    const Readiness ready = wait_for(&stream, interest, cancel, deadline);
    if (ready.woken) return cancelled(address);
    if (ready.writable && stream.send({}).status == IoStatus::failed) return silences.closed;
    if (!ready.readable && steady_now_ns() >= deadline) return silences.late;
  }
  return std::nullopt;
}

/// The hub's answer to HELLO. Nothing: it is WELCOME.
std::optional<NetError> await_welcome(Stream& stream, DialHandshake& handshake,
                                      const Address& address, Deadline deadline,
                                      const WakeSignal& cancel) {
  auto state = DialHandshake::State::need_more;
  const Take take = [&](std::span<const std::byte> bytes) {
    state = handshake.take(bytes);
    return state == DialHandshake::State::need_more ? handshake.missing() : 0;
  };
  const Silences silences{
      closed_early(address),
      {Fault::timeout,
       "the peer at " + address.url() + " does not answer HELLO; is it a hub, and not stopped?"}};
  if (auto error =
          read_answer(stream, handshake.missing(), take, address, silences, deadline, cancel))
    return error;
  if (state == DialHandshake::State::goodbye) return refused(handshake.goodbye(), address);
  if (state == DialHandshake::State::failed)
    return NetError{handshake.error().fault, address.url() + ": " + handshake.error().sentence};
  return std::nullopt;
}

Result<StreamPointer, NetError> dial_target(const DialTarget& target, const SocketOptions& options,
                                            Deadline deadline, const WakeSignal& cancel) {
  const auto found = find_addresses(target.address, deadline, cancel);
  if (!found) return found.error();
  std::optional<NetError> last;
  for (const HostAddress& each : *found) {
    auto dialed = dial_one(reinterpret_cast<const sockaddr*>(each.data()),
                           static_cast<socklen_t>(each.size()), target, options, deadline, cancel);
    if (dialed || dialed.error().fault == Fault::cancelled) return dialed;
    last = dialed.error();
  }
  return *last;  // find_addresses() gave one at least
}

/// A stream to `to` that the proxy relays.
Result<StreamPointer, NetError> dial_through(const ProxyAddress& proxy, const Address& to,
                                             const SocketOptions& options, Deadline deadline,
                                             const WakeSignal& cancel) {
  Address door;
  door.host = proxy.host;
  door.port = proxy.port;
  const auto of_proxy = [&](NetError error) {
    error.nobody_listens = false;  // what is known of the hub is nothing
    if (error.fault != Fault::cancelled)
      error.sentence = "through the proxy " + proxy.shown() + ": " + error.sentence;
    return error;
  };
  auto dialed = dial_target({door, "proxy"}, options, deadline, cancel);
  if (!dialed) return of_proxy(dialed.error());
  ProxyHandshake handshake(proxy, to);
  const std::string request = handshake.request();
  // One that refuses may close before it has read everything.
  const auto unwritten =
      write_all(**dialed, std::as_bytes(std::span(request)), door, deadline, cancel);
  if (unwritten && unwritten->fault != Fault::no_peer) return of_proxy(*unwritten);
  const Take take = [&](std::span<const std::byte> bytes) {
    return std::size_t{handshake.take(bytes[0]) == ProxyHandshake::State::need_more ? 1u : 0u};
  };
  const Silences silences{
      {Fault::no_peer, "it closed the connection without an answer; is it an HTTP proxy?"},
      {Fault::timeout, "it does not answer CONNECT; is it an HTTP proxy?"}};
  // Byte by byte: what follows the answer is the hub's.
  if (auto error = read_answer(**dialed, 1, take, door, silences, deadline, cancel))
    return of_proxy(*error);
  if (handshake.state() == ProxyHandshake::State::failed) return of_proxy(handshake.error());
  return dialed;
}

}  // namespace

Result<StreamPointer, NetError> dial(const Address& address, const SocketOptions& options,
                                     Deadline deadline, const WakeSignal& cancel) {
  return dial_target({address, "hub"}, options, deadline, cancel);
}

Result<Welcomed, NetError> dial_hub(const Address& address, const DialOptions& options,
                                    const proto::Hello& hello, Deadline deadline,
                                    const WakeSignal& cancel) {
  const bool proxied = options.proxy && !is_unix(address);
  auto dialed = proxied ? dial_through(*options.proxy, address, options.socket, deadline, cancel)
                        : dial(address, options.socket, deadline, cancel);
  if (!dialed) return dialed.error();
  Stream& stream = **dialed;
  // A hub that refuses may close before it has read everything: its words are still there to read.
  const auto unwritten = write_all(stream, encode_hello(hello), address, deadline, cancel);
  if (unwritten && unwritten->fault != Fault::no_peer) return *unwritten;
  DialHandshake handshake;
  if (auto error = await_welcome(stream, handshake, address, deadline, cancel)) {
    if (proxied && error->fault != Fault::refused && error->fault != Fault::cancelled)
      error->sentence += " (through the proxy " + options.proxy->shown() + ")";
    return std::move(*error);
  }
  return Welcomed{std::move(*dialed), handshake.welcome()};
}

std::int64_t DialBackoff::next_ns(std::uint64_t random) {
  const auto wait = static_cast<std::int64_t>(random % static_cast<std::uint64_t>(limit_ns_));
  limit_ns_ = std::min(limit_ns_ * 2, kLastNs);
  return wait;
}

}  // namespace gimnet::net
