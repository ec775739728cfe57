#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.hpp"
#include "client/nif/error.hpp"

// Where a hub is.

namespace gimnet::nif {

inline constexpr std::uint16_t kDefaultPort = 7450;

/// `tcp://host:port` or `unix:/path`, taken apart. A value type.
struct Endpoint {
  enum class Transport : std::uint8_t { tcp, unix_socket };
  Transport transport = Transport::tcp;
  std::string host;  ///< tcp: name or address, IPv6 without its brackets
  std::uint16_t port = 0;
  std::string path;  ///< unix_socket

  [[nodiscard]] std::string url() const;
  friend bool operator==(const Endpoint&, const Endpoint&) = default;
};

/// Errors: NIF_BAD_ARGUMENT with a sentence that names the URL and the forms that are understood.
[[nodiscard]] Result<Endpoint, Failure> parse_endpoint(std::string_view url);

/// What to try, in this order: `url` if not empty, else GIMNET_HUB of the environment, else the
/// user's default Unix socket (left out where its folder is missing or another user's) and then
/// tcp://127.0.0.1:7450.
[[nodiscard]] Result<std::vector<Endpoint>, Failure> endpoints_for(std::string_view url);

}  // namespace gimnet::nif
