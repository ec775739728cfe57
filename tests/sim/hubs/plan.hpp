#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "hub/limits.hpp"
#include "tests/sim/random.hpp"

namespace gimnet::sim::hubs {

/// One hub as its operator set it up.
struct HubPlan {
  std::uint16_t hub = 1;
  bool configured = true;
  std::uint64_t unique = 0;  ///< the state folder
  bool collides = false;     ///< another hub has its id or its state folder: it may stay out
  std::int64_t wall_ns = 0;  ///< its clock when the world begins, since 1970
};

/// One link as it is configured at its dialler, and the way that it takes. Its name is `wireN`.
struct WirePlan {
  std::size_t dialler = 0;
  std::size_t acceptor = 0;
  std::uint16_t cost = 0;  ///< 0: measured
  std::uint64_t delay_ms = 1;
  std::uint64_t jitter_ms = 0;
  std::uint32_t bytes_per_ms = 0;  ///< 0: no limit
  /// Of the link, with a keep-alive each quarter of it. 0: as of any link.
  std::uint32_t silent_ms = 0;
};

struct NodePlan {
  std::size_t hub = 0;
  std::size_t other = 0;  ///< where it goes when it moves; `hub`: it stays
  std::string name;
  std::uint32_t reads_per_ms = 0;  ///< bytes; 0: all that came
  bool heeds_pause = true;
  [[nodiscard]] bool moves() const { return other != hub; }
};

/// All that a seed draws: hubs, links, nodes, and which faults come.
struct Plan {
  std::vector<HubPlan> hubs;
  std::vector<WirePlan> wires;
  std::vector<NodePlan> nodes;
  hub::Limits limits;
  std::uint64_t faults = 0;     ///< that come before the world is left alone
  std::uint64_t kinds = 0;      ///< of faults, a bit set
  std::uint64_t say_every = 0;  ///< ms between two messages of a node
  bool collisions = false;      ///< some hub may have to stay out of the network
  bool copied = false;          ///< because it has the state folder of another one
};

/// The size of worlds.
struct Size {
  std::size_t hubs_least = 1;
  std::size_t hubs_most = 4;
  std::size_t nodes_most = 40;
};

/// Now and then a chain of 34, whose ends are too far from each other.
[[nodiscard]] Plan draw_plan(Random& random, const Size& size);

}  // namespace gimnet::sim::hubs
