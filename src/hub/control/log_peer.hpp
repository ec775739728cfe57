#pragma once

#include <string_view>

namespace gimnet::hub {

/// Who a peer is for the log's rates: the address without its port, or the user behind a Unix
/// socket without its process, so that a new connection is no new peer. `address` is as PeerInfo
/// has it. Valid until: `address` changes.
[[nodiscard]] constexpr std::string_view log_peer(std::string_view transport,
                                                  std::string_view address) {
  if (transport == "tcp") return address.substr(0, address.rfind(':'));
  const std::size_t user = address.find("uid ");
  return user == std::string_view::npos ? address : address.substr(user);
}

/// Who a peer is for limits on strangers: its address without the port; "" over loopback or a Unix
/// socket, where many are behind one address by right. Valid until: `address` changes.
[[nodiscard]] constexpr std::string_view remote_address(std::string_view transport,
                                                        std::string_view address) {
  if (transport != "tcp") return {};
  const bool local = address.starts_with("127.") || address.starts_with("[::1]") ||
                     address.starts_with("[::ffff:127.");
  return local ? std::string_view{} : log_peer(transport, address);
}

/// The crowd that a peer counts in, of which none may have more than half of the places: as
/// remote_address(), and over a Unix socket the user. Valid until: `address` changes.
[[nodiscard]] constexpr std::string_view crowd_of(std::string_view transport,
                                                  std::string_view address) {
  return transport == "unix" ? log_peer(transport, address) : remote_address(transport, address);
}

}  // namespace gimnet::hub
