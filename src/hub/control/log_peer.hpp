#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

#include "base/ids.hpp"
#include "base/log.hpp"
#include "hub/control/state/identity.hpp"
#include "proto/frame/frame_header.hpp"

namespace gimnet::hub {

/// The name of a peer for the log's rates: the address without its port, or the user behind a Unix
/// socket without its process, so that a new connection is no new peer. `address` is as PeerInfo
/// has it. Valid until: `address` changes.
[[nodiscard]] constexpr std::string_view log_peer(std::string_view transport,
                                                  std::string_view address) {
  if (transport == "tcp") return address.substr(0, address.rfind(':'));
  const std::size_t user = address.find("uid ");
  return user == std::string_view::npos ? address : address.substr(user);
}

/// The name of a peer for limits on strangers: its address without the port, of IPv6 the network of
/// 64 bits, of which one host has as many addresses as it likes; "" over loopback or a Unix socket,
/// where many are behind one address by right.
[[nodiscard]] std::string remote_address(std::string_view transport, std::string_view address);

/// The crowd that a peer counts in, of which none may have more than half of the places: the user
/// of a Unix socket, and of TCP peers the remote_address().
[[nodiscard]] inline std::string crowd_of(const Identity& identity, std::string_view address) {
  return identity == Identity::open() ? remote_address("tcp", address) : identity.text();
}

/// Logs that a frame of the link to that hub was dropped.
void log_refused(NodeId link, const proto::FrameHeader& header);

/// A ROUTE message of a link.
struct RouteMessage {
  std::string link;  ///< its name
  std::string peer;  ///< the hub at its other end: "hub 7 'lab'"
  std::uint16_t operation = 0;
};
/// Logs, at most each 10 s for one link, that a message was not what it should be.
void log_malformed(const RouteMessage& message, std::chrono::milliseconds now);

/// Logs at most one line each 10 s about one subject; the next one tells how many were left out.
/// For lines that a peer repeats as long as nobody changes its configuration. Thread safety: counts
/// for each thread apart. `now`: monotonic.
void log_seldom(LogLevel level, const LogSubject& subject, const std::string& text,
                std::chrono::milliseconds now);

}  // namespace gimnet::hub
