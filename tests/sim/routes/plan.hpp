#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/sim/random.hpp"

namespace gimnet::sim::routes {

/// One hub as its operator set it up.
struct HubPlan {
  std::uint16_t hub = 1;
  bool configured = true;
  std::uint64_t unique = 0;  ///< the state folder
};
/// One link as it is configured at its dialler. The ends may be given different costs.
struct WirePlan {
  std::size_t dialler = 0;
  std::size_t acceptor = 0;
  std::string name;
  std::uint16_t costs[2] = {10, 10};
};

/// All that a seed draws: hubs, links, and which faults come.
struct Plan {
  std::vector<HubPlan> hubs;
  std::vector<WirePlan> wires;
  std::uint32_t faults = 0;    ///< that come before the world is left alone
  std::uint32_t kinds = 0;     ///< of faults, a bit set
  std::uint64_t delay_ms = 5;  ///< the longest of a message
  std::uint32_t names = 0;     ///< of each hub alone
  std::uint32_t changes = 0;   ///< of names that all hubs want
  std::uint64_t grace_ms = 30'000;
  bool has_collisions = false;  ///< two hubs have one hub id, or one state folder
};

/// Worlds of 2 to 16 hubs, and now and then a chain of 34.
[[nodiscard]] Plan draw_plan(Random& random);

}  // namespace gimnet::sim::routes
