#pragma once

#include <cstddef>
#include <utility>

#include "hub/concurrent/mpsc_queue.hpp"
#include "hub/concurrent/waker.hpp"
#include "hub/shard/commands.hpp"

namespace gimnet::hub {

/// What shards hand to the conductor: control frames and the ends of connections. Never on the data path.
/// Thread safety: push() from each shard's thread with that shard's index; the rest from the conductor.
class ControlInbox {
 public:
  explicit ControlInbox(std::size_t shards) : queue_(shards) {}

  /// Shard: hands an event over and wakes the conductor if it sleeps. Order per shard is kept.
  void push(ShardEvent event) {
    const std::size_t shard = event.shard.value();
    queue_.push(shard, std::move(event));
    waker_.wake();
  }

  /// Conductor: calls `take` for up to `most` events; returns how many.
  template <class Take>
  std::size_t drain(std::size_t most, Take&& take) {
    return queue_.drain(most, take);
  }
  /// Conductor: its descriptor becomes readable at push() after prepare_to_sleep().
  [[nodiscard]] Waker& waker() { return waker_; }
  [[nodiscard]] bool empty() const { return queue_.empty(); }

 private:
  MpscQueue<ShardEvent> queue_;
  Waker waker_;
};

}  // namespace gimnet::hub
