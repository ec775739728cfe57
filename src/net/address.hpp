#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "base/result.hpp"
#include "net/net_error.hpp"

namespace gimnet::net {

inline constexpr std::uint16_t kDefaultPort = 7450;
/// A Unix socket's path is at most this long (sockaddr_un).
inline constexpr std::size_t kSocketPathMax = 107;

/// The place of a hub: `tcp://host:port` or `unix:/path`, taken apart. A value type.
struct Address {
  enum class Scheme : std::uint8_t { tcp, unix_socket };
  Scheme scheme = Scheme::tcp;
  std::string host;  ///< tcp: name or address, IPv6 without its brackets
  std::uint16_t port = 0;
  std::string path;  ///< unix_socket

  [[nodiscard]] std::string url() const;
  friend bool operator==(const Address&, const Address&) = default;
};

/// An address to dial; with `least_port` 0 one to listen on, where the system may choose the port.
/// Errors: Fault::bad_address with a sentence that names the URL and the forms that are understood.
[[nodiscard]] Result<Address, NetError> parse_address(std::string_view url,
                                                      std::uint16_t least_port = 1);

}  // namespace gimnet::net
