#pragma once

#include <array>
#include <compare>
#include <cstdint>

#include "base/ids.hpp"

// Names of a hub among all hubs (docs/protocol.md, section 10). Thread safety: value types.

namespace gimnet::proto {

/// Names the state folder of a hub: it stays the same when the hub starts again or has another hub
/// id. Ordered byte by byte.
struct UniqueId {
  std::array<std::uint8_t, 16> bytes{};
  friend constexpr auto operator<=>(const UniqueId&, const UniqueId&) = default;
};

/// Random at each start of a hub: tells a restart and a copied state folder from the same process.
using HubInstance = StrongId<struct HubInstanceTag, std::uint64_t>;

/// Names one record of routes. Two hubs that have the same hub id differ in it.
struct HubKey {
  HubId hub;
  UniqueId unique;
  friend constexpr auto operator<=>(const HubKey&, const HubKey&) = default;
};

}  // namespace gimnet::proto
