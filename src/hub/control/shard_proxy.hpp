#pragma once

#include "base/ids.hpp"
#include "hub/control/state/place.hpp"
#include "hub/shard/commands.hpp"

namespace gimnet::hub {

/// The session at that place, as its shard knows it.
[[nodiscard]] inline SessionRef ref_of(const Place& place) {
  return SessionRef{place.slot, place.generation};
}

/// The conductor's door to the shards. Thread safety: the conductor's thread only.
class ShardProxy {
 public:
  virtual ~ShardProxy() = default;
  /// Hands a command over; each shard carries its commands out in the order in which they were
  /// sent.
  virtual void send(ShardIndex shard, ShardCommand command) = 0;
  [[nodiscard]] virtual std::size_t shards() const = 0;
};

}  // namespace gimnet::hub
