#pragma once

#include "net/stream.hpp"

namespace gimnet::hub::benchmarks {

/// Takes everything and keeps nothing: what is left is the hub's own work.
class NullStream final : public net::Stream {
 public:
  [[nodiscard]] net::IoResult receive(std::span<std::byte>) override { return {}; }
  [[nodiscard]] net::IoResult send(std::span<const iovec> pieces) override {
    std::size_t bytes = 0;
    for (const iovec& piece : pieces) bytes += piece.iov_len;
    return {net::IoStatus::ok, bytes};
  }
  void shut_down() override {}
  [[nodiscard]] std::uint64_t unsent_bytes() const override { return 0; }
  void limit_unsent(std::uint32_t) override {}
  void limit_unacknowledged(std::uint32_t) override {}
  [[nodiscard]] int descriptor() const override { return -1; }
};

}  // namespace gimnet::hub::benchmarks
