#include "hub/control/state/slot_pool.hpp"

#include "base/check.hpp"

namespace gimnet::hub {

SlotPool::SlotPool(std::size_t shards) : shards_(shards) {
  GIMNET_CHECK(shards >= 1 && shards <= 255);
}

Place SlotPool::take() {
  std::size_t best = turn_;
  for (std::size_t i = 1; i < shards_.size(); ++i) {
    const std::size_t candidate = (turn_ + i) % shards_.size();
    if (shards_[candidate].held < shards_[best].held) best = candidate;
  }
  turn_ = (best + 1) % shards_.size();
  return take_on(ShardIndex{static_cast<std::uint8_t>(best)});
}

Place SlotPool::take_on(ShardIndex index) {
  GIMNET_CHECK(index.value() < shards_.size());
  Shard& shard = shards_[index.value()];
  std::uint32_t slot = shard.slots;
  if (shard.free.empty()) {
    ++shard.slots;
  } else {
    slot = shard.free.back();
    shard.free.pop_back();
  }
  ++shard.held;
  // One count for all slots: it comes round after 2^32 sessions, long after the last frame for the
  // earlier holder.
  if (++last_generation_ == 0) ++last_generation_;
  return Place{index, ConnectionSlot{slot}, last_generation_};
}

void SlotPool::give_back(const Place& place) {
  Shard& shard = shards_[place.shard.value()];
  GIMNET_CHECK(shard.held > 0 && place.slot.value() < shard.slots);
  --shard.held;
  shard.free.push_back(place.slot.value());
}

}  // namespace gimnet::hub
