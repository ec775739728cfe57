#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/nif/error.hpp"
#include "client/nif/session.hpp"
#include "proto/control/link.hpp"

namespace gimnet::nif {

/// The opening and HELLO as they go out.
[[nodiscard]] std::vector<std::byte> encode_hello(const proto::Hello& hello);
/// A GOODBYE frame.
[[nodiscard]] std::vector<std::byte> encode_goodbye(proto::GoodbyeCode code, std::string sentence);
/// What a GOODBYE means for nif_connect().
[[nodiscard]] nif_status status_of(proto::GoodbyeCode code);

/// The dialer's side of the handshake: takes the hub's bytes until WELCOME or GOODBYE is whole. The
/// hub is not trusted. Thread safety: one thread; no sockets, no clocks. Memory: at most
/// kAnswerBytesMax.
class Handshake {
 public:
  /// Opening and WELCOME together; the longest legal one is far shorter.
  static constexpr std::size_t kAnswerBytesMax = 8 * 1024;

  enum class State : std::uint8_t { need_more, welcome, goodbye, failed };

  /// `resume`: the HELLO asked for it; `former_hub_epoch`: what it named as the hub's earlier
  /// epoch, 0: none. Only where it did both may WELCOME say `resumed`.
  Handshake(bool resume, std::uint64_t former_hub_epoch)
      : resume_(resume), former_hub_epoch_(former_hub_epoch) {}

  /// Bytes as they came. REQUIRES: the last call answered need_more, or there was none.
  [[nodiscard]] State take(std::span<const std::byte> bytes);

  /// After `welcome`.
  [[nodiscard]] const Session& session() const { return session_; }
  /// After `welcome`: what came behind it.
  [[nodiscard]] std::span<const std::byte> rest() const {
    return std::span(bytes_).subspan(taken_);
  }
  /// After `goodbye`.
  [[nodiscard]] const proto::Goodbye& goodbye() const { return goodbye_; }
  /// After `failed`: what is wrong with the peer.
  [[nodiscard]] const Failure& failure() const { return failure_; }

 private:
  State fail(nif_status status, std::string sentence);
  State take_opening();
  State take_frame(std::span<const std::byte> payload);
  State take_welcome(const proto::Welcome& welcome);

  const bool resume_;
  const std::uint64_t former_hub_epoch_;
  std::vector<std::byte> bytes_;
  std::size_t taken_ = 0;
  Session session_;
  proto::Goodbye goodbye_;
  Failure failure_;
};

}  // namespace gimnet::nif
