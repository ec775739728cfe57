#pragma once

#include <cstdint>

#include "base/ids.hpp"

namespace gimnet::hub {

/// Where a session lives: its shard, its slot there, and which of the slot's holders it is (never
/// 0).
struct Place {
  ShardIndex shard;
  ConnectionSlot slot;
  std::uint32_t generation = 0;
  friend bool operator==(const Place&, const Place&) = default;
};

}  // namespace gimnet::hub
