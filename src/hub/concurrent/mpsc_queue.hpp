#pragma once

#include <array>
#include <cstddef>
#include <utility>
#include <vector>

#include "base/check.hpp"

#ifdef GIMNET_TSAN_QUEUE
#include <deque>
#include <mutex>
#else
#include <concurrentqueue/concurrentqueue.h>
#endif

namespace gimnet::hub {

/// Many producers, one consumer, each producer's order kept; unbounded by itself (its users bound
/// it). Thread safety: push(p, ...) only from producer p's thread; drain() only from the
/// consumer's; empty() from anywhere.
template <class T>
class MpscQueue {
 public:
  explicit MpscQueue(std::size_t producers)
#ifndef GIMNET_TSAN_QUEUE
      : queue_(kInitialItems)
#endif
  {
#ifndef GIMNET_TSAN_QUEUE
    tokens_.reserve(producers);
    for (std::size_t i = 0; i < producers; ++i) tokens_.emplace_back(queue_);
#else
    static_cast<void>(producers);
#endif
  }

  void push(std::size_t producer, T item) {
#ifdef GIMNET_TSAN_QUEUE
    static_cast<void>(producer);
    const std::lock_guard lock(mutex_);
    items_.push_back(std::move(item));
#else
    // It fails where there is no memory for another block; an item that vanishes would be a loss
    // that nobody counts.
    GIMNET_CHECK(queue_.enqueue(tokens_[producer], std::move(item)));
#endif
  }

  /// Calls take(T&&) for up to `most` items; returns how many.
  template <class Take>
  std::size_t drain(std::size_t most, Take&& take) {
    return drain(most, [] {}, take);
  }
  /// The same, with on_taken() called after some items were taken out and before they are looked
  /// at: what their producers did before they pushed them can be seen then.
  template <class Taken, class Take>
  std::size_t drain(std::size_t most, Taken&& on_taken, Take&& take) {
    std::size_t taken = 0;
    while (taken < most) {
      std::array<T, kBatch> batch{};
      const std::size_t count = pop(batch.data(), most - taken < kBatch ? most - taken : kBatch);
      if (count != 0) on_taken();
      for (std::size_t i = 0; i < count; ++i) take(std::move(batch[i]));
      taken += count;
      if (count == 0) break;
    }
    return taken;
  }

  /// An estimate while producers run; exact when they do not.
  [[nodiscard]] bool empty() const {
#ifdef GIMNET_TSAN_QUEUE
    const std::lock_guard lock(mutex_);
    return items_.empty();
#else
    return queue_.size_approx() == 0;
#endif
  }

 private:
  static constexpr std::size_t kBatch = 32;
  static constexpr std::size_t kInitialItems = 1024;

  std::size_t pop(T* into, std::size_t most) {
#ifdef GIMNET_TSAN_QUEUE
    const std::lock_guard lock(mutex_);
    std::size_t count = 0;
    while (count < most && !items_.empty()) {
      into[count++] = std::move(items_.front());
      items_.pop_front();
    }
    return count;
#else
    // From all producers in turns: the queue by itself would empty one before it looks at the next,
    // and a busy one would keep the others waiting for ever.
    std::size_t count = 0;
    for (std::size_t tried = 0; tried < tokens_.size() && count < most; ++tried) {
      count += queue_.try_dequeue_bulk_from_producer(tokens_[turn_], into + count, most - count);
      turn_ = turn_ + 1 == tokens_.size() ? 0 : turn_ + 1;
    }
    return count;
#endif
  }

#ifdef GIMNET_TSAN_QUEUE
  // ThreadSanitizer does not model the fences inside concurrentqueue and would report races that
  // are none.
  mutable std::mutex mutex_;
  std::deque<T> items_;  // Limit: its users', as of the queue in whose place it stands
#else
  moodycamel::ConcurrentQueue<T> queue_;
  std::vector<moodycamel::ProducerToken> tokens_;
  std::size_t turn_ = 0;  ///< the consumer's: whose items are taken next
#endif
};

}  // namespace gimnet::hub
