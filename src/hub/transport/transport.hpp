#pragma once

#include <sys/uio.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace gimnet::hub {

enum class IoStatus : std::uint8_t {
  ok,           ///< `bytes` were moved, at least one
  would_block,  ///< nothing can be moved now; wait for readiness
  closed,       ///< the peer closed its side in order
  failed,       ///< reset, or another error that ends the connection
};

struct IoResult {
  IoStatus status = IoStatus::would_block;
  std::size_t bytes = 0;
};

/// A byte stream to one peer: the seam under a connection. TCP and Unix sockets
/// (transport/socket_transport) implement it, and for tests a pipe in memory with short writes and
/// faults (tests/support). One virtual call per system call, never per frame. Thread safety: none;
/// belongs to the thread of its connection. Ownership: owns its descriptor.
class Transport {
 public:
  virtual ~Transport() = default;

  /// Reads what is there, at most `into.size()` bytes, without waiting. REQUIRES: `into` is not
  /// empty.
  [[nodiscard]] virtual IoResult receive(std::span<std::byte> into) = 0;
  /// Writes as much of `pieces` as is taken without waiting. REQUIRES: at least one piece, at
  /// most 64.
  [[nodiscard]] virtual IoResult send(std::span<const iovec> pieces) = 0;
  /// Bytes that were taken by send() and have not left this machine's send queue, or 0 if that
  /// can't be known.
  [[nodiscard]] virtual std::uint64_t unsent_bytes() const = 0;
  /// From now on at most about `bytes` wait unsent behind send(): for a peer that does not take
  /// everything at once. 0: no bound.
  virtual void limit_unsent(std::uint32_t bytes) = 0;
  /// From now on the connection breaks where the peer's machine does not acknowledge what was sent,
  /// or has no room for it, for so long. 0: as long as the system waits, many minutes. For TCP
  /// only: the end of a Unix socket's peer is known at once.
  virtual void limit_unacknowledged(std::uint32_t ms) = 0;
  /// The descriptor to wait on, or -1 for a transport that is not one of the kernel's.
  [[nodiscard]] virtual int descriptor() const = 0;
};

/// Where a connection came from, as people read it.
struct PeerInfo {
  std::string transport;  ///< "tcp" or "unix"
  std::string address;    ///< "127.0.0.1:41234", or "pid 77 uid 1000"
};

}  // namespace gimnet::hub
