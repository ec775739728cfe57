#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "net/address.hpp"
#include "net/net_error.hpp"
#include "net/proxy_address.hpp"

namespace gimnet::net {

/// The dialler's side of CONNECT (RFC 9110, 9.3.6): asks an HTTP proxy for a tunnel and takes its
/// answer, a status line and header lines, up to the empty line. The proxy is not trusted. Thread
/// safety: one thread; no sockets, no clocks. Memory: at most kAnswerBytesMax.
class ProxyHandshake {
 public:
  static constexpr std::size_t kAnswerBytesMax = 8 * 1024;

  enum class State : std::uint8_t { need_more, open, failed };

  /// REQUIRES: `to` is a TCP address.
  ProxyHandshake(const ProxyAddress& proxy, const Address& to);

  /// The bytes to send. They have the password.
  [[nodiscard]] std::string request() const;
  /// The next byte of the answer. Behind its last one begins what the hub says. REQUIRES: the state
  /// is need_more.
  State take(std::byte byte);
  [[nodiscard]] State state() const { return state_; }
  /// After `failed`: Fault::no_peer, and what the proxy said; who it is says the caller.
  [[nodiscard]] const NetError& error() const { return error_; }

 private:
  State fail(std::string sentence);
  State judge();
  [[nodiscard]] std::string refusal(int code, const std::string& said) const;

  const ProxyAddress proxy_;
  const std::string to_;  ///< host:port
  std::string answer_;
  State state_ = State::need_more;
  NetError error_{Fault::no_peer, ""};
};

}  // namespace gimnet::net
