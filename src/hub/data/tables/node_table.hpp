#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "base/ids.hpp"

namespace gimnet::hub {

/// The place of a node's session. A generation is never 0 for a session that exists. It is compared
/// when a frame reaches the slot, so that a frame for a node that left never reaches the next
/// holder of its slot.
struct NodePlace {
  ShardIndex shard;
  ConnectionSlot slot;
  std::uint32_t generation = 0;

  [[nodiscard]] bool exists() const { return generation != 0; }
  /// The place of a node that goes on under another index.
  [[nodiscard]] static NodePlace renumbered() { return {ShardIndex{0}, ConnectionSlot{1}, 0}; }
  [[nodiscard]] bool is_renumbered() const { return generation == 0 && slot.value() != 0; }
  friend bool operator==(const NodePlace&, const NodePlace&) = default;
};
/// Slots fit in 24 bits beside shard (8) and generation (32) in one atomic word.
inline constexpr std::uint32_t kSlotsMax = 1u << 24;
/// The most shards that a hub can have: as many as bits in a set of them.
inline constexpr std::size_t kShardsMax = 64;

[[nodiscard]] constexpr std::uint64_t pack(const NodePlace& place) {
  return (static_cast<std::uint64_t>(place.generation) << 32) |
         (static_cast<std::uint64_t>(place.shard.value()) << 24) | place.slot.value();
}
[[nodiscard]] constexpr NodePlace unpack(std::uint64_t word) {
  return NodePlace{ShardIndex{static_cast<std::uint8_t>(word >> 24)},
                   ConnectionSlot{static_cast<std::uint32_t>(word & (kSlotsMax - 1))},
                   static_cast<std::uint32_t>(word >> 32)};
}

/// Node index to place, for the nodes of this hub: a flat array of 2^20 words, and a bit for each,
/// in memory that the kernel hands out page by page. Thread safety: one writer (the conductor), any
/// number of readers; reads are wait-free.
class NodeTable {
 public:
  NodeTable();
  ~NodeTable();
  NodeTable(const NodeTable&) = delete;
  NodeTable& operator=(const NodeTable&) = delete;

  /// REQUIRES: index < 2^20, place.slot < kSlotsMax, place.shard < kShardsMax. A place with
  /// generation 0 clears the entry, or says that the node was renumbered.
  void publish(std::uint32_t index, NodePlace place);

  /// REQUIRES: index < 2^20. Generation 0 when no session has that index.
  [[nodiscard]] NodePlace find(std::uint32_t index) const {
    return unpack(words_[index].load(
        std::memory_order_acquire));  // pairs with the release store in publish()
  }

  /// Changes with each publish(), and after it: what find() said before then may be so no longer.
  [[nodiscard]] std::uint64_t epoch() const {
    return epoch_.load(std::memory_order_acquire);  // pairs with the release in publish()
  }

  /// That node may be on its way back to a hub that was restarted: until it is there, or
  /// expect_nobody(), it is `away`, not unknown. REQUIRES: 0 < index < 2^20.
  void expect(std::uint32_t index);
  void expect_nobody();
  [[nodiscard]] bool may_return(std::uint32_t index) const {
    // relaxed: words a reason, decides nothing
    return (expected_[index / 64].load(std::memory_order_relaxed) >> (index % 64) & 1) != 0;
  }

  /// The shards (a bit set) on which a node lives.
  [[nodiscard]] std::uint64_t shards() const {
    return shards_.load(
        std::memory_order_relaxed);  // relaxed: a shard that is missed had no node a moment ago
  }
  /// The number of nodes that live on that shard.
  [[nodiscard]] std::uint32_t nodes_on(ShardIndex shard) const {
    return nodes_by_shard_[shard.value()].load(std::memory_order_relaxed);  // relaxed: as above
  }

 private:
  /// Returns how many there are now.
  std::uint32_t change_count(ShardIndex shard, int change);
  void change_expected(std::uint32_t index, bool expected);

  std::atomic<std::uint64_t>* words_;
  std::atomic<std::uint64_t>* expected_;  ///< a bit for each index, in the same memory
  std::atomic<std::uint64_t> shards_{0};
  std::atomic<std::uint64_t> epoch_{0};
  std::array<std::atomic<std::uint32_t>, kShardsMax> nodes_by_shard_{};
};

}  // namespace gimnet::hub
