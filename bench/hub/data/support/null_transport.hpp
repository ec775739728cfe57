#pragma once

#include "hub/transport/transport.hpp"

namespace gimnet::hub::benchmarks {

/// Takes everything and keeps nothing: what is left is the hub's own work.
class NullTransport final : public Transport {
 public:
  [[nodiscard]] IoResult receive(std::span<std::byte>) override { return {}; }
  [[nodiscard]] IoResult send(std::span<const iovec> pieces) override {
    std::size_t bytes = 0;
    for (const iovec& piece : pieces) bytes += piece.iov_len;
    return {IoStatus::ok, bytes};
  }
  [[nodiscard]] std::uint64_t unsent_bytes() const override { return 0; }
  void limit_unsent(std::uint32_t) override {}
  void limit_unacknowledged(std::uint32_t) override {}
  [[nodiscard]] int descriptor() const override { return -1; }
};

}  // namespace gimnet::hub::benchmarks
