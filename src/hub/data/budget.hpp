#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>

namespace gimnet::hub {

/// The bytes that waiting messages of the whole hub may keep from being freed (`budget_bytes`), and
/// the number of connections that have data waiting. Shards lease bytes in pieces, so that no frame
/// touches a shared word. Another one is for retained messages (`retained_budget_bytes`), which
/// lease what they count. Thread safety: any thread.
class Budget {
 public:
  /// `shards`: so many lease from it.
  explicit Budget(std::uint64_t bytes, std::size_t shards = 1)
      : total_(static_cast<std::int64_t>(bytes)),
        piece_bytes_(std::clamp(total_ / kPieces / static_cast<std::int64_t>(shards),
                                kPieceBytesMin, kPieceBytesMax)),
        left_(total_) {}

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
  [[nodiscard]] std::int64_t total() const { return total_; }
  /// A shard leases so many bytes at a time.
  [[nodiscard]] std::int64_t piece_bytes() const { return piece_bytes_; }

  /// So many more connections have data waiting, or fewer.
  void add_waiting(std::int64_t connections) {
    waiting_.fetch_add(connections, std::memory_order_relaxed);  // relaxed: a count
  }
  // relaxed: a count
  [[nodiscard]] std::int64_t waiting() const { return waiting_.load(std::memory_order_relaxed); }

 private:
  /// A shard keeps up to three pieces that it does not use, which to the others are not free: of
  /// all shards together at most 3/64 of the budget.
  static constexpr std::int64_t kPieces = 64;
  static constexpr std::int64_t kPieceBytesMin = 4 * 1024;
  static constexpr std::int64_t kPieceBytesMax = 1 << 20;

  const std::int64_t total_;
  const std::int64_t piece_bytes_;
  std::atomic<std::int64_t> left_;
  std::atomic<std::int64_t> waiting_{0};
};

/// A shard's part of the budget, and the share of it that each connection has while memory is
/// scarce. Thread safety: one shard.
class BudgetLease {
 public:
  /// Memory is scarce while less than this part of the budget is free.
  static constexpr std::int64_t kScarcePart = 3;
  /// While memory is scarce, connections that keep up may wait without a share until less than this
  /// part of the budget is free. The shares of all connections together are as much, so that they
  /// stay within the budget. The other half of the third is for bursts beside slow readers.
  static constexpr std::int64_t kSharedPart = 6;
  /// The least share: room for some small messages, however many connections wait.
  static constexpr std::uint64_t kShareBytesMin = 4 * 1024;
  /// The largest share: what one read brings. A connection for which more waits does not keep up.
  static constexpr std::uint64_t kShareBytesMax = 256 * 1024;
  /// Shards tell each other this often how many of their connections wait. In that time a shard
  /// reads some MiB at most, which is little beside a sixth of the budget.
  static constexpr std::uint64_t kTellMs = 10;

  explicit BudgetLease(Budget& budget) : budget_(budget) {}
  ~BudgetLease() {
    budget_.give_back(leased_);
    budget_.add_waiting(-told_);
  }
  BudgetLease(const BudgetLease&) = delete;
  BudgetLease& operator=(const BudgetLease&) = delete;

  /// Counts bytes that a waiting frame pins; they exist already, so this never fails, but may
  /// exhaust the lease.
  void take(std::uint64_t bytes) {
    used_ += static_cast<std::int64_t>(bytes);
    while (used_ > leased_ && budget_.lease(piece_bytes_)) leased_ += piece_bytes_;
  }
  void give_back(std::uint64_t bytes) {
    used_ -= static_cast<std::int64_t>(bytes);
    while (leased_ - used_ > kKeptPieces * piece_bytes_) {
      leased_ -= piece_bytes_;
      budget_.give_back(piece_bytes_);
    }
  }
  /// Memory that took `counted` bytes takes `bytes` now.
  void change(std::uint64_t& counted, std::uint64_t bytes) {
    if (bytes > counted) take(bytes - counted);
    if (bytes < counted) give_back(counted - bytes);
    counted = bytes;
  }
  /// Is more pinned than could be leased? Then what would have to wait is refused.
  [[nodiscard]] bool exhausted() {
    if (used_ <= leased_) return false;
    take(0);
    return used_ > leased_;
  }

  /// Once a turn: finds out whether memory is scarce, and how large a connection's share is then.
  void begin_turn(std::uint64_t now_ms) {
    if (now_ms - told_ms_ >= kTellMs) tell(now_ms);
    scarce_ = free_bytes() < budget_.total() / kScarcePart;
    if (scarce_) update_share();
  }
  [[nodiscard]] bool scarce() const { return scarce_; }
  /// Is so much free now that a connection which keeps up needs no share? Asked for each message
  /// that has to wait while memory is scarce: the copies of one turn may come to a sixth.
  [[nodiscard]] bool has_spare() const { return free_bytes() >= budget_.total() / kSharedPart; }
  /// Bytes that may wait for one connection. REQUIRES: scarce().
  [[nodiscard]] std::uint64_t share_bytes() const { return share_bytes_; }
  /// A connection of this shard begins to have data waiting.
  void begin_waiting() { ++waiting_; }
  void end_waiting() { --waiting_; }

 private:
  static constexpr std::int64_t kKeptPieces = 2;

  /// Bytes that this shard has leased and does not use are free, too.
  [[nodiscard]] std::int64_t free_bytes() const {
    return budget_.left() + std::max<std::int64_t>(leased_ - used_, 0);
  }
  void tell(std::uint64_t now_ms) {
    told_ms_ = now_ms;
    if (waiting_ != told_) budget_.add_waiting(waiting_ - told_);
    told_ = waiting_;
  }
  void update_share() {
    const std::int64_t waiting = std::max<std::int64_t>(budget_.waiting() - told_ + waiting_, 1);
    share_bytes_ = std::clamp(static_cast<std::uint64_t>(budget_.total() / kSharedPart / waiting),
                              kShareBytesMin, kShareBytesMax);
  }

  Budget& budget_;
  const std::int64_t piece_bytes_ = budget_.piece_bytes();
  std::int64_t leased_ = 0;
  std::int64_t used_ = 0;
  std::int64_t waiting_ = 0;
  std::int64_t told_ = 0;  ///< of waiting_, what the budget knows
  std::uint64_t told_ms_ = 0;
  std::uint64_t share_bytes_ = kShareBytesMax;
  bool scarce_ = false;
};

}  // namespace gimnet::hub
