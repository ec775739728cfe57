#pragma once

#include <sys/uio.h>

#include <cstddef>
#include <cstdint>
#include <span>

namespace gimnet::net {

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

/// One send() takes at most so many pieces.
inline constexpr std::size_t kPiecesMax = 64;

/// A byte stream to one peer: the seam under hub and library. TCP and Unix sockets
/// (net/socket_stream) implement it, and for tests a pipe in memory with short writes and faults
/// (tests/support). A stream may keep bytes of its own between its caller and the kernel, as one
/// that encrypts does. One virtual call per system call, never per frame.
///
/// Thread safety: in the hub a stream belongs to one thread and takes no lock. In the library
/// receive(), send() and shut_down() come from different threads at once; a stream with state of
/// its own then brings its own lock. Reading never waits for writing, nor writing for reading.
/// Ownership: owns its descriptor.
class Stream {
 public:
  virtual ~Stream() = default;

  /// Reads what is there, at most `into.size()` bytes, without waiting. REQUIRES: `into` is not
  /// empty.
  [[nodiscard]] virtual IoResult receive(std::span<std::byte> into) = 0;
  /// Gives the kernel what pending_out() counts, and then as much of `pieces` as is taken without
  /// waiting. Without pieces: `ok` when nothing is pending any more. REQUIRES: at most kPiecesMax
  /// pieces, none empty.
  [[nodiscard]] virtual IoResult send(std::span<const iovec> pieces) = 0;
  /// Nothing is sent behind what send() took. The peer sees the end when that has left; while
  /// pending_out() is not 0, send() without pieces goes on with it.
  virtual void shut_down() = 0;
  /// Bytes that receive() would give although the poller does not see them.
  [[nodiscard]] virtual std::size_t pending_in() const { return 0; }
  /// Bytes that the stream took, or made itself, and has not given to the kernel. They count as
  /// unsent. 0 once the stream has failed.
  [[nodiscard]] virtual std::size_t pending_out() const { return 0; }
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
  /// The descriptor to wait on, or -1 for a stream that is not one of the kernel's.
  [[nodiscard]] virtual int descriptor() const = 0;
};

/// The readiness that a poller waits for on a stream.
struct Interest {
  bool read = false;
  bool write = false;
  friend bool operator==(const Interest&, const Interest&) = default;
};

/// The one answer to what a stream is waited for. `may_read`: its owner takes bytes.
/// `write_blocked`: send() took less than it was offered.
[[nodiscard]] constexpr Interest interest_of(bool may_read, bool write_blocked,
                                             std::size_t pending_out) {
  return {.read = may_read, .write = write_blocked || pending_out != 0};
}

}  // namespace gimnet::net
