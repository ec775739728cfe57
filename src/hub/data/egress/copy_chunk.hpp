#pragma once

#include <cstdint>

#include "hub/data/egress/egress_context.hpp"
#include "hub/data/egress/run.hpp"

namespace gimnet::hub {

/// Memory into which one outbox copies frames, one behind the other. A new chunk is larger than the
/// one before it while much is copied. Thread safety: one shard. Ownership: a reference to the
/// chunk, as each copy has one.
class CopyChunk {
 public:
  /// `waits`: something waits in the outbox, so that the copy may stay there for long.
  [[nodiscard]] Run copy(const Run& run, bool waits, EgressContext& context);
  /// Is it in this chunk?
  [[nodiscard]] bool holds(const Run& run) const { return run.buffer.get() == chunk_.get(); }
  /// The place of the next copy, and the room there. REQUIRES: a copy is in it.
  [[nodiscard]] std::byte* end() const { return chunk_->data + used_; }
  [[nodiscard]] std::uint32_t room() const { return chunk_->capacity - used_; }
  /// So much was copied there by the caller. REQUIRES: it fits.
  void take(std::uint32_t bytes) { used_ += bytes; }
  /// Nothing waits any more: the next chunk is smaller.
  void let_go() {
    chunk_.reset();
    next_bytes_ /= kGrowth;
  }

 private:
  static constexpr std::uint32_t kFirstBytes = 256 - kBufferRoom;
  static constexpr std::uint32_t kGrowth = 4;  // from one size of the pool to the next

  BufferRef chunk_;
  std::uint32_t used_ = 0;
  std::uint32_t next_bytes_ = 0;  ///< size of the next chunk
};

}  // namespace gimnet::hub
