#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "net/net_error.hpp"
#include "proto/control/link.hpp"

namespace gimnet::net {

/// The opening and HELLO as they go out.
[[nodiscard]] std::vector<std::byte> encode_hello(const proto::Hello& hello);
/// A GOODBYE frame.
[[nodiscard]] std::vector<std::byte> encode_goodbye(proto::GoodbyeCode code, std::string sentence);

/// The dialler's side of the handshake: takes the hub's bytes until WELCOME or GOODBYE is whole.
/// The hub is not trusted. Thread safety: one thread; no sockets, no clocks. Memory: at most
/// kAnswerBytesMax.
class DialHandshake {
 public:
  /// Opening and WELCOME together; the longest legal one is far shorter.
  static constexpr std::size_t kAnswerBytesMax = 8 * 1024;

  enum class State : std::uint8_t { need_more, welcome, goodbye, failed };

  /// Bytes as they came. REQUIRES: the last call answered need_more, or there was none.
  [[nodiscard]] State take(std::span<const std::byte> bytes);

  /// So many bytes at least are still to come. Who reads no more leaves what stands behind WELCOME
  /// in the stream. REQUIRES: as take().
  [[nodiscard]] std::size_t missing() const;

  /// After `welcome`.
  [[nodiscard]] const proto::Welcome& welcome() const { return welcome_; }
  /// After `goodbye`.
  [[nodiscard]] const proto::Goodbye& goodbye() const { return goodbye_; }
  /// After `failed`: Fault::protocol or Fault::bad_version.
  [[nodiscard]] const NetError& error() const { return error_; }

 private:
  State fail(Fault fault, std::string sentence);
  State take_opening();
  State take_frame(std::span<const std::byte> payload);

  std::vector<std::byte> bytes_;
  std::size_t taken_ = 0;
  proto::Welcome welcome_;
  proto::Goodbye goodbye_;
  NetError error_{Fault::protocol, ""};
};

}  // namespace gimnet::net
