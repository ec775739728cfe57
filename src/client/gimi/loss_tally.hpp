#pragma once

#include <atomic>
#include <cstdint>

#include "gimnet/gimi.hpp"
#include "proto/frame/frame_header.hpp"

namespace gimnet::gimi {

/// Counts messages that were lost on their way to this node, by reason. NIF counts the unreadable
/// ones. Thread safety: add() from the library's thread, counts() from any.
class LossTally {
 public:
  /// `count` as NIF_GAP has it: messages, or frames that went with a connection.
  void add(proto::DropReason reason, std::uint64_t count) {
    std::atomic<std::uint64_t>& sum = place(reason);
    // One thread writes; who reads wants a recent value, and nothing that goes with it.
    sum.store(sum.load(std::memory_order_relaxed) + count, std::memory_order_relaxed);
  }

  /// A message of a group that no subscription of this node has.
  void add_unknown_service() {
    // See add().
    unknown_service_.store(unknown_service_.load(std::memory_order_relaxed) + 1,
                           std::memory_order_relaxed);
  }

  [[nodiscard]] LostCounts counts() const {
    // relaxed: see add()
    return {incomplete_.load(std::memory_order_relaxed),
            too_large_.load(std::memory_order_relaxed),  // see add()
            frames_broken_off_.load(std::memory_order_relaxed),
            unknown_service_.load(std::memory_order_relaxed), 0};
  }

 private:
  [[nodiscard]] std::atomic<std::uint64_t>& place(proto::DropReason reason) {
    if (reason == proto::DropReason::cut_message) return incomplete_;
    return reason == proto::DropReason::too_large ? too_large_ : frames_broken_off_;
  }

  std::atomic<std::uint64_t> incomplete_{0};
  std::atomic<std::uint64_t> too_large_{0};
  std::atomic<std::uint64_t> frames_broken_off_{0};
  std::atomic<std::uint64_t> unknown_service_{0};
};

}  // namespace gimnet::gimi
