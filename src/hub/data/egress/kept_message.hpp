#pragma once

#include <cstdint>
#include <vector>

#include "hub/data/egress/egress_context.hpp"
#include "hub/data/egress/entry.hpp"

namespace gimnet::hub {

/// One message that is kept, whole or as far as it came: references to its frames, and small ones
/// in memory of their own, so that they do not keep a read buffer. What append() keeps counts
/// against a budget. Cleared and filled again it does not allocate. Thread safety: one shard.
class KeptMessage {
 public:
  KeptMessage() = default;
  KeptMessage(KeptMessage&&) = default;
  KeptMessage& operator=(KeptMessage&&) = default;

  [[nodiscard]] bool empty() const { return frames_ == 0; }
  [[nodiscard]] std::uint32_t frames() const { return frames_; }
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }

  /// The next frame. `shared`: others keep the same bytes, so a reference costs nothing. What is
  /// kept counts against `budget`.
  void append(const Run& frame, bool shared, BudgetLease& budget, EgressContext& context);
  /// Begins a message that is copied into memory of its own, about `bytes` of it, by
  /// append_copy(). It does not count against the budget. Memory of the message before is used
  /// again where it fits.
  void begin_copy(std::uint32_t bytes, EgressContext& context);
  /// Returns where the copy is, which nobody else has yet.
  std::byte* append_copy(const Run& frame, EgressContext& context);
  void clear();

  /// Calls take(const Run&) for each stretch of frames, in order.
  template <class Take>
  void for_each(Take&& take) const {
    if (first_.frames != 0) take(first_);
    for (const Run& run : more_) take(run);
  }

 private:
  /// A stretch below this is copied out of the slab that it lies in.
  static constexpr std::uint32_t kCopyBytesMax = kSharedChunkBytes;

  /// So much memory of its own a message keeps for the next one, however small that is.
  static constexpr std::uint32_t kOwnRoomBytes = 4 * 1024;

  [[nodiscard]] Run copy(const Run& frame, bool scarce, EgressContext& context);
  [[nodiscard]] Run copy_into_chunk(const Run& frame, EgressContext& context);
  void add(Run piece);

  Run first_;
  std::vector<Run> more_;
  BufferRef chunk_;  ///< where copies go
  std::uint32_t chunk_used_ = 0;
  std::uint32_t frames_ = 0;
  std::uint64_t bytes_ = 0;
};

}  // namespace gimnet::hub
