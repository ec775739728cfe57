#pragma once

#include <cstdint>
#include <vector>

#include "hub/control/state/session_token.hpp"

namespace gimnet::hub {

/// What the state machines want to outlive the hub. A value type.
struct Durable {
  std::uint64_t node_count = 0;   ///< indices granted to newcomers of this start, the next block included
  std::uint64_t group_count = 0;  ///< the same for services
  std::uint32_t node_mark = 1;    ///< from which the next start hands out node indices
  std::uint32_t group_mark = 1;   ///< the same for groups
  std::vector<SessionToken> kicked;
};

}  // namespace gimnet::hub
