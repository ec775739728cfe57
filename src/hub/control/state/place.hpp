#pragma once

#include <cstdint>

#include "base/ids.hpp"

namespace gimnet::hub {

/// The place of a session: its shard, its slot there, and its number among the slot's holders
/// (never 0).
struct Place {
  ShardIndex shard;
  ConnectionSlot slot;
  std::uint32_t generation = 0;
  friend bool operator==(const Place&, const Place&) = default;
};

}  // namespace gimnet::hub
