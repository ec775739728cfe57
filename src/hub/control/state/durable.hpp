#pragma once

#include <vector>

#include "hub/control/state/index_pool.hpp"
#include "hub/control/state/session_token.hpp"

namespace gimnet::hub {

/// What the state machines want to outlive the hub. A value type.
struct Durable {
  IndexPool::Grant nodes;
  IndexPool::Grant groups;
  std::vector<SessionToken> kicked;
};

}  // namespace gimnet::hub
