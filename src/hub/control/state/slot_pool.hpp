#pragma once

#include <cstdint>
#include <vector>

#include "hub/control/state/place.hpp"

namespace gimnet::hub {

/// The slots of all shards and how full each shard is: decides where a new session lives.
/// Thread safety: none. Limits: 2^24 slots a shard, which the limit on nodes keeps out of reach.
class SlotPool {
 public:
  /// REQUIRES: 1 <= shards <= 255.
  explicit SlotPool(std::size_t shards);

  /// A slot on the least loaded shard; among equals they take turns.
  [[nodiscard]] Place take();
  /// A slot on that shard. REQUIRES: index < shards().
  [[nodiscard]] Place take_on(ShardIndex index);
  /// REQUIRES: the place is held. Its slot may be handed out again at once, under another
  /// generation.
  void give_back(const Place& place);

  [[nodiscard]] std::size_t shards() const { return shards_.size(); }
  [[nodiscard]] std::uint32_t load(ShardIndex shard) const { return shards_[shard.value()].held; }

 private:
  struct Shard {
    std::vector<std::uint32_t> free;
    std::uint32_t slots = 0;  ///< ever handed out
    std::uint32_t held = 0;
  };
  std::vector<Shard> shards_;
  std::size_t turn_ = 0;
  std::uint32_t last_generation_ = 0;
};

}  // namespace gimnet::hub
