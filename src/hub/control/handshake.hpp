#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "hub/limits.hpp"
#include "proto/control/link.hpp"

namespace gimnet::hub {

/// What a peer said before it was admitted: the opening and HELLO, looked at byte by byte, so that
/// the first impossible byte ends it. Thread safety: none. Ownership: of one buffer of
/// limits.handshake_bytes, all that a stranger costs.
class Handshake {
 public:
  explicit Handshake(const Limits& limits);

  enum class Verdict : std::uint8_t {
    more,     ///< right so far
    hello,    ///< hello() is there
    refused,  ///< refusal() says why
    garbage,  ///< not this protocol: not worth an answer
  };

  /// Where the next bytes go; never empty while the verdict is `more`.
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

}  // namespace gimnet::hub
