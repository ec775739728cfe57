#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "client/gimi/message_queue.hpp"

namespace gimnet::gimi {

/// The queues of a node that may hold more messages than their options say. They share the bytes of
/// what waits in them, so that a program with many subscriptions stays as small as one with a few.
/// Thread safety: guarded by its owner. Ownership: the queues outlive it, or leave().
class GrowingQueues {
 public:
  /// Bytes that one queue may take: a burst of 90,000 small messages.
  static constexpr std::size_t kQueueBytesMax = std::size_t{16} << 20;
  /// Bytes that all of them may take: as many as the queues of keys for which nobody asked.
  static constexpr std::size_t kBytesMax = std::size_t{64} << 20;

  /// The queue is a new one, or was given other terms.
  void look_at(MessageQueue& queue) {
    const auto known = std::ranges::find(queues_, &queue);
    if (queue.grows() == (known != queues_.end())) return;
    if (queue.grows()) {
      queues_.push_back(&queue);
    } else {
      queues_.erase(known);
    }
    share();
  }
  /// The queue goes.
  void leave(MessageQueue& queue) {
    if (std::erase(queues_, &queue) != 0) share();
  }

 private:
  void share() {
    for (MessageQueue* queue : queues_)
      queue->allow(std::min(kQueueBytesMax, kBytesMax / queues_.size()));
  }

  std::vector<MessageQueue*> queues_;  ///< Limit: all that are there
};

}  // namespace gimnet::gimi
