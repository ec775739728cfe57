#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "base/result.hpp"

namespace gimnet::hub {

/// An address to listen on: `tcp://127.0.0.1:7450`, `tcp://[::1]:0` (any free port),
/// `unix:/run/tcphub.sock`.
struct ListenUrl {
  enum class Scheme : std::uint8_t { tcp, unix_socket };

  Scheme scheme = Scheme::tcp;
  std::string host;  ///< tcp: a numeric address, without brackets
  std::uint16_t port = 0;
  std::string path;  ///< unix_socket: absolute

  /// As it is written on a command line.
  [[nodiscard]] std::string text() const;
  /// Can only this machine reach it? True for Unix sockets, 127.0.0.0/8 and ::1.
  [[nodiscard]] bool is_local() const;
  friend bool operator==(const ListenUrl&, const ListenUrl&) = default;
};

/// A Unix socket's path is at most this long (sockaddr_un).
inline constexpr std::size_t kSocketPathMax = 107;

/// Errors: a sentence that names the address and says how to write it. Host names but `localhost`
/// are not looked up.
[[nodiscard]] Result<ListenUrl> parse_listen_url(std::string_view text);

}  // namespace gimnet::hub
