#pragma once

#include <array>
#include <cstdint>
#include <thread>

#include "base/check.hpp"
#include "base/ids.hpp"
#include "hub/data/budget.hpp"
#include "hub/data/buffer_pool.hpp"
#include "hub/data/egress/drop_book.hpp"
#include "hub/data/egress/piece_pool.hpp"
#include "hub/data/tally.hpp"
#include "hub/limits.hpp"
#include "proto/frame/flow.hpp"

namespace gimnet::hub {

/// The thread that owns an object. The object calls check_here() wherever it is entered. Debug
/// builds abort if another thread comes in; release builds check nothing. Thread safety: none.
class OwnerThread {
 public:
  /// The first that comes is the owner.
  void check_here() const {
#ifndef NDEBUG
    const std::thread::id here = std::this_thread::get_id();
    if (owner_ == std::thread::id{}) owner_ = here;
    GIMNET_ASSERT(owner_ == here);
#endif
  }
  /// The owner has ended, or hands over: the next that comes is the owner. REQUIRES: no call at the
  /// same time.
  void let_go() {
#ifndef NDEBUG
    owner_ = std::thread::id{};
#endif
  }

#ifndef NDEBUG
 private:
  mutable std::thread::id owner_;
#endif
};

/// Are frames in that buffer copied before they wait at the cost of `budget`? Small ones are, and
/// all while memory is scarce, unless they lie in a chunk; and those in a buffer that the other
/// budget pays for, or it would pay for what waits here.
[[nodiscard]] inline bool must_copy(const Buffer& buffer, bool small, const BudgetLease& budget) {
  if (buffer.payer != nullptr && buffer.payer != &budget) return true;
  return (small || budget.scarce()) && buffer.kind != BufferKind::chunk;
}

/// Reaches the senders that fill an outbox, on whatever shard they are. Called only when a queue is
/// full or has room again, never per frame.
class SenderSignals {
 public:
  virtual ~SenderSignals() = default;
  virtual void pause(NodeId sender, const proto::flow::Target& target) = 0;
  virtual void resume(NodeId sender, const proto::flow::Target& target) = 0;
  /// The sender ignored its PAUSE past the reserve, or had no time to heed it: stop reading it
  /// until release() was called as often as hold().
  virtual void hold(NodeId sender) = 0;
  virtual void release(NodeId sender) = 0;
};

/// The memory of what waits for one sort of connection: nodes, or links. Thread safety: one shard.
struct WaitingMemory {
  BudgetLease& budget;
  PiecePool& pieces;
};

/// The parts that all outboxes of a shard share. Thread safety: one shard.
struct EgressContext {
  const Limits& limits;
  BufferPool& pool;
  std::array<WaitingMemory, 2> memory;  ///< of nodes, of links
  Tally& tally;
  DropBook& drops;
  SenderSignals& signals;
  std::uint64_t now_ms = 0;      ///< monotonic
  std::int64_t now_wall_ns = 0;  ///< since 1970, for AGE and TRACE
  HubId hub{};                   ///< for TRACE
  OwnerThread owner{};           ///< the shard's: asked wherever the data plane is entered
};

}  // namespace gimnet::hub
