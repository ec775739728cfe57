#pragma once

#include <cstdint>
#include <memory>

#include "net/stream.hpp"

namespace gimnet::net {

/// Sizes of a socket's buffers, in bytes. 0: the system's.
struct SocketOptions {
  std::uint32_t receive_bytes = 0;
  std::uint32_t send_bytes = 0;
};

/// A TCP or Unix stream socket. It keeps nothing of its own, so it needs no lock. Thread
/// safety, ownership: as Stream.
class SocketStream final : public Stream {
 public:
  enum class Family : std::uint8_t { tcp, unix_socket };

  /// Takes `descriptor`, makes it non-blocking, and sets no delay and the sizes of its buffers.
  /// REQUIRES: a stream socket of that family, connected
  /// before anything is read or sent.
  SocketStream(int descriptor, Family family, const SocketOptions& options = {});
  ~SocketStream() override;
  SocketStream(const SocketStream&) = delete;
  SocketStream& operator=(const SocketStream&) = delete;

  [[nodiscard]] IoResult receive(std::span<std::byte> into) override;
  [[nodiscard]] IoResult send(std::span<const iovec> pieces) override;
  void shut_down() override;
  [[nodiscard]] std::uint64_t unsent_bytes() const override;
  /// REQUIRES: options.send_bytes was not 0, for a Unix socket.
  void limit_unsent(std::uint32_t bytes) override;
  void limit_unacknowledged(std::uint32_t ms) override;
  [[nodiscard]] int descriptor() const override { return descriptor_; }

 private:
  const int descriptor_;
  const Family family_;
  const int send_buffer_bytes_;
};

/// The stream of a socket that was dialled or accepted: the one place that decides what stands
/// between the two. It has a source file of its own, so that a test can put another one there.
/// Arguments: as SocketStream's.
[[nodiscard]] std::unique_ptr<Stream> make_stream(int descriptor, SocketStream::Family family,
                                                  const SocketOptions& options);

}  // namespace gimnet::net
