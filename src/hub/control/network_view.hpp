#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/ids.hpp"
#include "hub/control/link_options.hpp"
#include "proto/control/ctrl_network.hpp"

namespace gimnet::hub {

/// A link as it is shown to people. A value type.
struct LinkView {
  std::string name;
  HubId hub;         ///< at the other end; 0: not known
  std::string peer;  ///< the URL that is dialled, or where the other side came from
  proto::ctrl::LinkState state = proto::ctrl::LinkState::dialling;
  bool dialled = false;              ///< by this hub
  std::uint16_t cost = 0;            ///< 0: not measured yet
  std::uint32_t rtt_us = 0;          ///< the lowest of this connection; 0: none yet
  std::int64_t clock_offset_ns = 0;  ///< of the other hub's clock to this one's
  std::int64_t clock_error_ns = 0;   ///< half of the round trip; 0: not known
  std::uint64_t queued_bytes = 0;
  std::uint64_t sent_bytes = 0;
  std::uint64_t received_bytes = 0;
  std::uint64_t accepted = 0;    ///< data frames from it
  std::uint64_t delivered = 0;   ///< data frames to it
  std::uint64_t dropped = 0;     ///< data frames for it
  std::uint64_t unsure = 0;      ///< of these, those that may have arrived
  std::uint64_t queue_full = 0;  ///< of those dropped, those that found its queue full
  std::string last_error;        ///< of the last attempt or connection; "": none
};

/// A hub of the network as it is shown to people. A value type.
struct HubView {
  HubId hub;
  std::string name;
  std::string version;
  std::uint16_t distance = 0;  ///< links on the way; 0: this hub
  std::uint32_t cost = 0;      ///< of the way; 0 also while its first link is not measured
  HubId via;                   ///< the next hub; 0: this hub, or no way
  bool reachable = false;
  bool too_far = false;        ///< reachable, but over more links than a frame may cross
  std::uint32_t nodes = 0;     ///< of another hub, as far as it is known
  std::uint32_t services = 0;  ///< the same
  /// The neighbours that it names, with costs.
  struct Edge {
    HubId hub;
    std::uint16_t cost = 0;  ///< 0: not measured yet
  };
  std::vector<Edge> neighbours;
};

/// The network as this hub sees it, and what may be changed of it. Thread safety: the conductor's
/// thread only.
class NetworkView {
 public:
  virtual ~NetworkView() = default;
  /// This hub first, then by ascending id.
  [[nodiscard]] virtual std::vector<HubView> hubs() const = 0;
  [[nodiscard]] virtual std::vector<LinkView> links() const = 0;
  /// Of what came over links and was not taken, by name, since the hub began.
  struct Count {
    const char* name;
    std::uint64_t value = 0;
  };
  [[nodiscard]] virtual std::vector<Count> not_taken() const = 0;
  /// Dials a further link from now on. Returns why not, or "".
  [[nodiscard]] virtual std::string add_link(const DialledLink& link) = 0;
  /// Ends a link and dials it no more. Returns why not, or "".
  [[nodiscard]] virtual std::string remove_link(std::string_view name) = 0;
  /// Fixes the cost of a dialled link; 0: measured. Returns why not, or "".
  [[nodiscard]] virtual std::string set_link_cost(std::string_view name, std::uint16_t cost) = 0;
};

}  // namespace gimnet::hub
