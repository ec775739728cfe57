#pragma once

#include <cstddef>
#include <memory>

#include "hub/data/budget.hpp"
#include "hub/data/egress/run.hpp"

namespace gimnet::hub {

class PiecePool;
struct MorePieces;

/// Gives a piece, and all behind it, back to their pool.
struct ReturnPieces {
  void operator()(MorePieces* first) const;
};
using PieceRef = std::unique_ptr<MorePieces, ReturnPieces>;

/// More of a fragmented message: what did not lie behind its first piece.
struct MorePieces {
  Run run;
  PieceRef next;
  PiecePool* pool = nullptr;
};

/// The pieces of a shard's waiting messages. Those that were used once are kept for the next
/// message, so that fragments do not allocate; those in use are counted against the budget, since a
/// hostile node makes them as large as what they refer to. Thread safety: one shard. Must outlive
/// all pieces.
class PiecePool {
 public:
  explicit PiecePool(BudgetLease& budget) : budget_(budget) {}
  ~PiecePool();
  PiecePool(const PiecePool&) = delete;
  PiecePool& operator=(const PiecePool&) = delete;

  [[nodiscard]] PieceRef take(Run run);
  /// Pieces that wait for their next use.
  [[nodiscard]] std::size_t kept() const { return kept_; }

  /// Pieces beyond these are freed.
  static constexpr std::size_t kKeptMax = 4'096;

 private:
  friend struct ReturnPieces;
  void give_back(MorePieces& piece);

  BudgetLease& budget_;
  MorePieces* free_ = nullptr;  ///< linked by `next`
  std::size_t kept_ = 0;
};

}  // namespace gimnet::hub
