#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "base/result.hpp"
#include "net/address.hpp"

namespace gimnet::net {

/// The place of an HTTP proxy: `http://host:port` or `http://user:password@host:port`, taken apart.
/// A value type.
struct ProxyAddress {
  std::string host;  ///< name or address, IPv6 without its brackets
  std::uint16_t port = 0;
  std::string user;      ///< "": none; %XX is decoded, as in the password
  std::string password;  ///< never shown
  /// `host:port`, an IPv6 address in brackets.
  [[nodiscard]] std::string place() const;
  /// The URL, with `***` in place of the password.
  [[nodiscard]] std::string shown() const;
  friend bool operator==(const ProxyAddress&, const ProxyAddress&) = default;
};

/// The proxy to reach that hub through. Errors: as parse_proxy(); a Unix socket, which no proxy
/// reaches.
[[nodiscard]] Result<ProxyAddress> proxy_towards(const Address& hub, std::string_view url);

/// Errors: a sentence that names the proxy as shown_proxy() does, and says how to write it.
[[nodiscard]] Result<ProxyAddress> parse_proxy(std::string_view url);

/// The URL of a proxy, also one that is not understood, with `***` in place of its password.
[[nodiscard]] std::string shown_proxy(std::string_view url);

}  // namespace gimnet::net
