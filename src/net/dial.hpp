#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "base/result.hpp"
#include "net/address.hpp"
#include "net/proxy_address.hpp"
#include "net/socket_stream.hpp"
#include "net/wait.hpp"
#include "proto/control/link.hpp"

namespace gimnet::net {

/// Connects, trying each address of the host. Gives up at the deadline or when `cancel` is raised.
/// Thread safety: any thread. Errors: all but those of a handshake.
[[nodiscard]] Result<std::unique_ptr<Stream>, NetError> dial(const Address& address,
                                                             const SocketOptions& options,
                                                             Deadline deadline,
                                                             const WakeSignal& cancel);

/// An admitted connection.
struct Welcomed {
  std::unique_ptr<Stream> stream;
  proto::Welcome welcome;
};

/// The terms of dialling a hub. A value type.
struct DialOptions {
  SocketOptions socket{};
  std::optional<ProxyAddress> proxy{};  ///< for TCP; nothing: straight
};

/// Dials, through the proxy where there is one, and shakes hands. Errors: those of dial(),
/// Fault::protocol, Fault::bad_version, and Fault::refused with the hub's GOODBYE. A proxy that
/// refuses is Fault::no_peer.
[[nodiscard]] Result<Welcomed, NetError> dial_hub(const Address& address,
                                                  const DialOptions& options,
                                                  const proto::Hello& hello, Deadline deadline,
                                                  const WakeSignal& cancel);

/// The time to wait before dialling again: full jitter, a random time below 50 ms, 100 ms, 200 ms
/// ... 1 s. Thread safety: one thread.
class DialBackoff {
 public:
  /// `random`: any 64 random bits.
  [[nodiscard]] std::int64_t next_ns(std::uint64_t random);
  void reset() { limit_ns_ = kFirstNs; }

 private:
  static constexpr std::int64_t kFirstNs = 50'000'000;
  static constexpr std::int64_t kLastNs = 1'000'000'000;
  std::int64_t limit_ns_ = kFirstNs;
};

}  // namespace gimnet::net
