#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "hub/concurrent/mpsc_queue.hpp"
#include "hub/concurrent/waker.hpp"
#include "hub/shard/commands.hpp"

namespace gimnet::hub {

/// The door from the shards to the conductor, for control frames and the ends of connections. Never
/// on the data path. Thread safety: push() from each shard's thread with that shard's index; the
/// rest from the conductor.
class ControlInbox {
 public:
  explicit ControlInbox(std::size_t shards) : queue_(shards), pushed_(shards), taken_(shards) {}

  /// Shard: hands an event over and wakes the conductor if it sleeps. Order per shard is kept.
  void push(ShardEvent event) {
    const std::size_t shard = event.shard.value();
    queue_.push(shard, std::move(event));
    pushed_[shard].fetch_add(
        1, std::memory_order_release);  // pairs with the acquire in drain_present()
    waker_.wake();
  }

  /// Conductor: calls `take` for up to `most` events; returns how many.
  template <class Take>
  std::size_t drain(std::size_t most, Take&& take) {
    return queue_.drain(most, [&](ShardEvent&& event) {
      ++taken_[event.shard.value()];
      take(std::move(event));
    });
  }
  /// Conductor: calls `take` for all events that were pushed before, however many; later ones may
  /// be among them.
  template <class Take>
  void drain_present(Take&& take) {
    for (std::size_t shard = 0; shard < pushed_.size(); ++shard) {
      // acquire pairs with the release in push(): what was counted can be taken.
      const std::uint64_t present = pushed_[shard].load(std::memory_order_acquire);
      while (taken_[shard] < present && drain(kEventsABatch, take) != 0) {
      }
    }
  }
  /// The conductor takes so many at a time, before it lets others have a turn.
  static constexpr std::size_t kEventsABatch = 256;
  /// Conductor: its descriptor becomes readable at push() after prepare_to_sleep().
  [[nodiscard]] Waker& waker() { return waker_; }
  [[nodiscard]] bool empty() const { return queue_.empty(); }

 private:
  MpscQueue<ShardEvent> queue_;
  std::vector<std::atomic<std::uint64_t>> pushed_;  ///< by shard, since the start
  std::vector<std::uint64_t> taken_;                ///< the conductor's: the same
  Waker waker_;
};

}  // namespace gimnet::hub
