#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>

#include "base/ids.hpp"
#include "hub/observe/counters.hpp"

namespace gimnet::hub {

/// The counts of one session since it began, over all its connections. They count with the shard's
/// counters of the same names: the sum over the sessions that have not ended is the shards' sum. Of
/// `dropped` that holds for frames to a node that was found. Thread safety: written by the
/// session's shard, read as SessionGauges says.
struct SessionCounters {
  std::atomic<std::uint32_t> generation{0};  ///< of the session; 0: none yet
  Counter accepted;                          ///< frames taken from it
  Counter received_bytes;
  Counter delivered;  ///< frames handed to the kernel for it, or confirmed where resume is on
  Counter sent_bytes;
  Counter dropped;     ///< frames that were for it
  Counter unsure;      ///< of these, those that a broken link may have delivered
  Counter queue_full;  ///< of these, those that found its queue full

  /// All counts are 0 again.
  void clear() {
    for (Counter* each :
         {&accepted, &received_bytes, &delivered, &sent_bytes, &dropped, &unsure, &queue_full})
      each->store(0);
  }
};

/// The same and what waits for it, in bytes, as numbers of one moment.
struct SessionCounts {
  std::uint64_t queued_bytes = 0;
  std::uint64_t accepted = 0;
  std::uint64_t received_bytes = 0;
  std::uint64_t delivered = 0;
  std::uint64_t sent_bytes = 0;
  std::uint64_t dropped = 0;
  std::uint64_t unsure = 0;
  std::uint64_t queue_full = 0;

  SessionCounts& operator+=(const SessionCounts& other) {
    queued_bytes += other.queued_bytes;
    accepted += other.accepted;
    received_bytes += other.received_bytes;
    delivered += other.delivered;
    sent_bytes += other.sent_bytes;
    dropped += other.dropped;
    unsure += other.unsure;
    queue_full += other.queue_full;
    return *this;
  }
};

/// Lets others read the state of each session of a shard. Thread safety: counts() from the thread
/// that gives out the slots, the rest from the shard. Limits: slots from `slots` on read as 0.
class SessionGauges {
 public:
  explicit SessionGauges(std::size_t slots)
      : slots_(slots), queued_(zeroed<Counter>(slots)), counters_(zeroed<SessionCounters>(slots)) {}

  /// The counters of a session that begins, all 0. Valid until: another one begins in its slot, or
  /// this object goes.
  [[nodiscard]] SessionCounters& begin(ConnectionSlot slot, std::uint32_t generation) {
    if (!counters_ || slot.value() >= slots_) return beyond_;
    SessionCounters& counters = counters_[slot.value()];
    counters.clear();
    set_queued(slot, 0);
    // release pairs with the acquire in counts(): who sees the session sees nothing of the one
    // before.
    counters.generation.store(generation, std::memory_order_release);
    return counters;
  }
  /// Sets the bytes that wait for the slot's session.
  void set_queued(ConnectionSlot slot, std::uint64_t bytes) {
    if (!queued_ || slot.value() >= slots_) return;
    // The 0 of a session that begins or ends would make its page memory of its own.
    Counter& queued = queued_[slot.value()];
    if (queued.value() != bytes) queued.store(bytes);
  }
  /// As last written; all 0 of a session that its shard does not know yet. REQUIRES: the session
  /// holds its slot.
  [[nodiscard]] SessionCounts counts(ConnectionSlot slot, std::uint32_t generation) const {
    if (!counters_ || !queued_ || slot.value() >= slots_) return {};
    const SessionCounters& counters = counters_[slot.value()];
    // acquire pairs with the release in begin().
    if (counters.generation.load(std::memory_order_acquire) != generation) return {};
    return {queued_[slot.value()].value(),   counters.accepted.value(),
            counters.received_bytes.value(), counters.delivered.value(),
            counters.sent_bytes.value(),     counters.dropped.value(),
            counters.unsure.value(),         counters.queue_full.value()};
  }

 private:
  struct Free {
    void operator()(void* memory) const { std::free(memory); }
  };
  // Zeroed memory that the kernel hands out page by page: a slot that was never used costs nothing,
  // and of `queued_`, which stands by itself for that, one that was never slow.
  template <class Each>
  using Zeroed = std::unique_ptr<Each[], Free>;
  template <class Each>
  [[nodiscard]] static Zeroed<Each> zeroed(std::size_t slots) {
    return Zeroed<Each>(static_cast<Each*>(std::calloc(slots, sizeof(Each))));
  }

  const std::size_t slots_;
  Zeroed<Counter> queued_;
  Zeroed<SessionCounters> counters_;
  SessionCounters beyond_;  ///< counted for nobody
};

}  // namespace gimnet::hub
