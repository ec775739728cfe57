#pragma once

#include <cstdint>

#include "hub/limits.hpp"
#include "hub/transport/transport.hpp"

namespace gimnet::hub {

/// A connected TCP or Unix stream socket. Thread safety, ownership: as Transport.
class SocketTransport final : public Transport {
 public:
  enum class Family : std::uint8_t { tcp, unix_socket };

  /// Takes `descriptor`, makes it non-blocking, and sets what the hub wants of it: no delay, a send
  /// buffer of limits.socket_send_bytes. REQUIRES: a connected stream socket of that family.
  SocketTransport(int descriptor, Family family, const Limits& limits);
  ~SocketTransport() override;
  SocketTransport(const SocketTransport&) = delete;
  SocketTransport& operator=(const SocketTransport&) = delete;

  [[nodiscard]] IoResult receive(std::span<std::byte> into) override;
  [[nodiscard]] IoResult send(std::span<const iovec> pieces) override;
  [[nodiscard]] std::uint64_t unsent_bytes() const override;
  void limit_unsent(std::uint32_t bytes) override;
  void limit_unacknowledged(std::uint32_t ms) override;
  [[nodiscard]] int descriptor() const override { return descriptor_; }

 private:
  const int descriptor_;
  const Family family_;
  const int send_buffer_bytes_;
};

}  // namespace gimnet::hub
