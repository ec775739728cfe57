#pragma once

#include <atomic>
#include <cstdint>

namespace gimnet::hub {

/// The bytes that all outboxes of the hub together may keep from being freed. Shards lease it in
/// pieces, so that no frame touches a shared word. Thread safety: any thread.
class Budget {
 public:
  explicit Budget(std::uint64_t bytes) : left_(static_cast<std::int64_t>(bytes)) {}

  /// Leases `bytes`, or nothing if less is left.
  [[nodiscard]] bool lease(std::int64_t bytes) {
    std::int64_t left =
        left_.load(std::memory_order_relaxed);  // relaxed: a count, it publishes nothing
    while (left >= bytes) {
      // relaxed: as above
      if (left_.compare_exchange_weak(left, left - bytes, std::memory_order_relaxed)) return true;
    }
    return false;
  }
  void give_back(std::int64_t bytes) {
    left_.fetch_add(bytes, std::memory_order_relaxed);  // relaxed: a count
  }
  // relaxed: a count
  [[nodiscard]] std::int64_t left() const { return left_.load(std::memory_order_relaxed); }

 private:
  std::atomic<std::int64_t> left_;
};

/// A shard's share of the budget. Thread safety: one shard.
class BudgetLease {
 public:
  explicit BudgetLease(Budget& budget) : budget_(budget) {}
  ~BudgetLease() { budget_.give_back(leased_); }
  BudgetLease(const BudgetLease&) = delete;
  BudgetLease& operator=(const BudgetLease&) = delete;

  /// Counts bytes that a waiting frame pins; they exist already, so this never fails, but may
  /// exhaust the lease.
  void take(std::uint64_t bytes) {
    used_ += static_cast<std::int64_t>(bytes);
    while (used_ > leased_ && budget_.lease(kPieceBytes)) leased_ += kPieceBytes;
  }
  void give_back(std::uint64_t bytes) {
    used_ -= static_cast<std::int64_t>(bytes);
    while (leased_ - used_ > kKeepBytes) {
      leased_ -= kPieceBytes;
      budget_.give_back(kPieceBytes);
    }
  }
  /// Is more pinned than could be leased? Then what would have to wait is refused.
  [[nodiscard]] bool exhausted() {
    if (used_ <= leased_) return false;
    take(0);
    return used_ > leased_;
  }

 private:
  static constexpr std::int64_t kPieceBytes = 1 << 20;
  static constexpr std::int64_t kKeepBytes = 2 * kPieceBytes;

  Budget& budget_;
  std::int64_t leased_ = 0;
  std::int64_t used_ = 0;
};

}  // namespace gimnet::hub
