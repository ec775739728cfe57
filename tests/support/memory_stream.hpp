#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "net/stream.hpp"

namespace gimnet::hub {

struct MemoryPipe;

/// The hub's end of a pipe in memory, which does what its peer says: short reads and writes, no
/// room, faults. Thread safety: none; both ends belong to one thread.
class MemoryStream final : public net::Stream {
 public:
  explicit MemoryStream(std::shared_ptr<MemoryPipe> pipe);
  ~MemoryStream() override;
  MemoryStream(const MemoryStream&) = delete;
  MemoryStream& operator=(const MemoryStream&) = delete;

  [[nodiscard]] net::IoResult receive(std::span<std::byte> into) override;
  [[nodiscard]] net::IoResult send(std::span<const iovec> pieces) override;
  void shut_down() override;
  /// The bytes that the peer has not read yet.
  [[nodiscard]] std::uint64_t unsent_bytes() const override;
  void limit_unsent(std::uint32_t bytes) override;
  void limit_unacknowledged(std::uint32_t ms) override;
  [[nodiscard]] int descriptor() const override { return -1; }

 private:
  std::shared_ptr<MemoryPipe> pipe_;
};

/// The other end, from which a test or a fuzzer plays a node. Outlives the transport: what that had
/// sent can still be read. Thread safety: as MemoryStream.
class MemoryPeer {
 public:
  static constexpr std::size_t kAll = ~std::size_t{0};

  MemoryPeer() = default;
  explicit MemoryPeer(std::shared_ptr<MemoryPipe> pipe);

  void write(std::span<const std::byte> bytes);
  /// Appends up to `most` bytes that the transport sent; returns how many.
  std::size_t read(std::vector<std::byte>& into, std::size_t most = kAll);
  /// Bytes that the transport sent and nobody has read.
  [[nodiscard]] std::size_t readable() const;

  /// The transport sees the end once it has read everything.
  void close();
  /// Every further call of the transport fails, also with bytes unread on both sides.
  void reset();
  /// After so many more bytes were sent to this peer the connection fails as by reset().
  void reset_after(std::size_t bytes);

  /// So many bytes wait unread at most; beyond it the transport would block.
  void set_room(std::size_t bytes);
  /// The next calls of send() take at most so many bytes each (0: would block); later ones as many
  /// as there is room.
  void plan_sends(std::vector<std::size_t> bytes);
  /// The next calls of receive() give at most so many bytes each (0: would block).
  void plan_receives(std::vector<std::size_t> bytes);

  /// Would a poller call the transport readable, or writable?
  [[nodiscard]] bool transport_readable() const;
  [[nodiscard]] bool transport_writable() const;
  /// The hub sends nothing any more.
  [[nodiscard]] bool shut_down() const;
  /// The hub has let its end go.
  [[nodiscard]] bool transport_gone() const;
  /// The last bound that limit_unsent() set.
  [[nodiscard]] std::uint32_t unsent_limit() const;
  /// The last bound that limit_unacknowledged() set.
  [[nodiscard]] std::uint32_t unacknowledged_limit() const;
  [[nodiscard]] std::uint64_t send_calls() const;

 private:
  std::size_t read_records(std::vector<std::byte>& into, std::size_t most);

  std::shared_ptr<MemoryPipe> pipe_;
};

/// Both ends of a new pipe. Where toy streams are wanted (tests/net/support) the hub's end is one
/// over the pipe, and the other end speaks its records: room, plans and faults count those.
[[nodiscard]] std::pair<std::unique_ptr<net::Stream>, MemoryPeer> make_memory_pipe();

}  // namespace gimnet::hub
