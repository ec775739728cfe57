#include "hub/data/fanout/mailbox.hpp"

#include <algorithm>

namespace gimnet::hub {

Mailbox::Mailbox(std::size_t shards, Bounds bounds, Waker& waker)
    : bounds_(bounds),
      waker_(waker),
      queue_(shards),
      pairs_(std::make_unique<Pair[]>(shards)),
      shards_(shards) {}

bool Mailbox::over(const Pair& pair, std::uint64_t entries, std::uint64_t bytes) {
  // relaxed: counts for a bound, see on_taken()
  const std::uint64_t waiting_entries =
      pair.sent_entries - pair.taken_entries.load(std::memory_order_relaxed);
  // relaxed: as above
  const std::uint64_t waiting_bytes =
      pair.sent_bytes - pair.taken_bytes.load(std::memory_order_relaxed);
  return waiting_entries > entries || waiting_bytes > bytes;
}

bool Mailbox::over_half(const Pair& pair) const {
  // relaxed: as above
  const std::uint64_t deliveries =
      pair.sent_deliveries - pair.taken_deliveries.load(std::memory_order_relaxed);
  return over(pair, bounds_.entries / 2, bounds_.bytes / 2) || deliveries > bounds_.deliveries / 2;
}

bool Mailbox::full(ShardIndex from, std::uint32_t bytes) const {
  const Pair& pair = pairs_[from.value()];
  // A stretch larger than the bound goes alone.
  return over(pair, bounds_.entries - 1,
              bounds_.bytes - std::min<std::uint64_t>(bytes, bounds_.bytes));
}

bool Mailbox::crowded(ShardIndex from) {
  Pair& pair = pairs_[from.value()];
  if (!over_half(pair)) return false;
  pair.sender_waits.store(true, std::memory_order_relaxed);  // relaxed: ordered by the fence
  std::atomic_thread_fence(std::memory_order_seq_cst);       // pairs with the fence in tell_room()
  return over_half(pair);
}

bool Mailbox::post(ShardIndex from, Mail mail) {
  Pair& pair = pairs_[from.value()];
  ++pair.sent_entries;
  pair.sent_bytes += mail.size;
  queue_.push(from.value(), Letter{from.value(), mail});
  return waker_.wake();
}

}  // namespace gimnet::hub
