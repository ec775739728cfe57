#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace gimnet::hub {

/// Tells when memory that readers may still look at can be freed (quiescent-state reclamation).
/// Each reader thread says "I hold nothing now" once a turn, or "I sleep"; a writer takes a ticket
/// after it unlinked something, and may free it when every reader has passed a quiet moment since.
/// Thread safety: each reader index belongs to one thread; ticket() and passed() to the one writer.
class Quiescence {
 public:
  explicit Quiescence(std::size_t readers) : readers_(readers) {}

  /// Reader: from here on until the next call this thread may hold pointers that it loads.
  void enter(std::size_t reader) {
    // release: what the last turn read was read before; pairs with the load in passed()
    readers_[reader].seen.store(epoch_.load(std::memory_order_acquire), std::memory_order_release);
    // Orders that store before the turn's loads of pointers, which are only acquire; its partner is
    // the fence in ticket(). Either the writer sees this reader, or the reader sees what the writer
    // unlinked.
    std::atomic_thread_fence(std::memory_order_seq_cst);
  }
  /// Reader: this thread holds nothing until its next enter().
  void leave(std::size_t reader) {
    readers_[reader].seen.store(kAway,
                                std::memory_order_release);  // pairs with the load in passed()
  }

  /// Writer: a moment after which what was unlinked before is invisible to readers that enter.
  [[nodiscard]] std::uint64_t ticket() {
    const std::uint64_t ticket =
        epoch_.fetch_add(1, std::memory_order_release) + 1;  // pairs with the load in enter()
    std::atomic_thread_fence(std::memory_order_seq_cst);     // pairs with the fence in enter()
    return ticket;
  }
  /// Writer: has every reader entered, or left, since `ticket`?
  [[nodiscard]] bool passed(std::uint64_t ticket) const {
    for (const Reader& reader : readers_) {
      if (reader.seen.load(std::memory_order_acquire) < ticket)
        return false;  // pairs with enter() and leave()
    }
    return true;
  }

 private:
  static constexpr std::uint64_t kAway = ~std::uint64_t{0};
  struct alignas(64) Reader {
    std::atomic<std::uint64_t> seen{kAway};
  };
  std::atomic<std::uint64_t> epoch_{1};
  std::vector<Reader> readers_;
};

}  // namespace gimnet::hub
