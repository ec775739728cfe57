#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "hub/control/shard_proxy.hpp"
#include "hub/data/tables/route_table.hpp"
#include "hub/network/state/network_map.hpp"

namespace gimnet::hub {

/// The next hops as the shards see them: publishes what changes, and sends control frames along
/// them. Thread safety: the conductor's thread only. Lifetime: its parts outlive it.
class NextHops {
 public:
  NextHops(RouteTable& routes, ShardProxy& shards) : routes_(routes), shards_(shards) {}

  /// Publishes the hops that differ from before. `place_of(LinkNumber, HubId)` gives the NextHop of
  /// a link to that hub, none if no shard has it.
  template <class PlaceOf>
  void publish(const std::array<LinkNumber, NetworkMap::kHubIds>& links, PlaceOf&& place_of) {
    std::uint64_t shards = 0;
    for (std::size_t hub = 0; hub < links.size(); ++hub) {
      if (links[hub] == LinkNumber{} && !published_[hub].exists()) continue;
      const HubId to{static_cast<std::uint16_t>(hub)};
      const NextHop next = links[hub] == LinkNumber{} ? NextHop{} : place_of(links[hub], to);
      if (next.exists()) shards |= std::uint64_t{1} << next.link.shard.value();
      if (next == published_[hub]) continue;
      published_[hub] = next;
      routes_.publish(to, next);
    }
    routes_.publish_shards(shards);
  }

  [[nodiscard]] const NextHop& find(HubId hub) const {
    return published_[hub.value() % published_.size()];
  }
  /// Sends a control frame to the next hop towards that hub, unless it came from there. False:
  /// there is no route.
  bool send_towards(HubId hub, std::vector<std::byte> frame, HubId from = kOwnHub) {
    const NextHop& next = find(hub);
    if (!next.exists() || (from != kOwnHub && next.neighbour == from)) return false;
    SendControlCommand command;
    command.session = {next.link.slot, next.link.generation};
    command.frame = std::move(frame);
    command.passed_on = true;
    shards_.send(next.link.shard, std::move(command));
    return true;
  }

 private:
  RouteTable& routes_;
  ShardProxy& shards_;
  std::array<NextHop, RouteTable::kHubIds> published_{};
};

}  // namespace gimnet::hub
