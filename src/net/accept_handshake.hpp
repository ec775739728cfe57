#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "proto/control/link.hpp"

namespace gimnet::net {

/// The acceptor's side of the handshake: takes the opening and HELLO of a peer that is not admitted
/// yet. It looks at each byte, so that the first impossible one ends it. Thread safety: one thread;
/// no sockets, no clocks. Ownership: of one buffer of `bytes_max`, all that a stranger costs.
class AcceptHandshake {
 public:
  explicit AcceptHandshake(std::size_t bytes_max);

  enum class Verdict : std::uint8_t {
    more,     ///< right so far
    hello,    ///< hello() is there
    refused,  ///< refusal() says why
    garbage,  ///< not this protocol: not worth an answer
  };

  /// The place of the next bytes; never empty while the verdict is `more`.
  [[nodiscard]] std::span<std::byte> room();
  /// `bytes` were put there. REQUIRES: at most room().size().
  [[nodiscard]] Verdict took(std::size_t bytes);

  /// Has it said anything?
  [[nodiscard]] bool begun() const { return size_ != 0; }
  [[nodiscard]] const proto::Hello& hello() const { return hello_; }
  [[nodiscard]] const proto::Goodbye& refusal() const { return refusal_; }

 private:
  [[nodiscard]] Verdict refuse(proto::GoodbyeCode code, std::string sentence);
  /// Looks at as much of the header as is there.
  [[nodiscard]] Verdict check_header(std::span<const std::byte> frame);
  [[nodiscard]] Verdict read_hello(std::span<const std::byte> payload);

  const std::size_t capacity_;
  std::unique_ptr<std::byte[]> buffer_;
  std::size_t size_ = 0;
  proto::Hello hello_;
  proto::Goodbye refusal_;
};

}  // namespace gimnet::net
