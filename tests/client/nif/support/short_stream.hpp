#pragma once

#include <sys/uio.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "net/stream.hpp"
#include "tests/client/nif/support/frames.hpp"

namespace gimnet::nif::test {

/// A kernel that takes `room` bytes, and then no more.
class ShortStream final : public net::Stream {
 public:
  [[nodiscard]] net::IoResult receive(std::span<std::byte> /*into*/) override { return {}; }
  [[nodiscard]] net::IoResult send(std::span<const iovec> pieces) override {
    if (on_send) on_send();
    if (fails) return {net::IoStatus::failed, 0};
    std::size_t taken = 0;
    for (const iovec& piece : pieces) {
      const std::size_t bytes = std::min(piece.iov_len, room);
      const auto* begin = static_cast<const std::byte*>(piece.iov_base);
      bytes_.insert(bytes_.end(), begin, begin + bytes);
      room -= bytes;
      taken += bytes;
    }
    return {taken > 0 ? net::IoStatus::ok : net::IoStatus::would_block, taken};
  }
  void shut_down() override {}
  [[nodiscard]] std::uint64_t unsent_bytes() const override { return 0; }
  void limit_unsent(std::uint32_t /*bytes*/) override {}
  void limit_unacknowledged(std::uint32_t /*ms*/) override {}
  [[nodiscard]] int descriptor() const override { return -1; }

  /// The payloads of the frames that came since the last look.
  [[nodiscard]] std::vector<std::string> taken() { return payloads(std::exchange(bytes_, {})); }

  std::size_t room = SIZE_MAX;
  bool fails = false;
  std::function<void()> on_send;

 private:
  std::vector<std::byte> bytes_;
};

}  // namespace gimnet::nif::test
