#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "base/endian.hpp"
#include "hub/data/egress/egress_context.hpp"
#include "hub/data/egress/lane_queue.hpp"
#include "hub/data/egress/run.hpp"

namespace gimnet::hub {

class CopyChunk;

/// The last run of a lane, while frames with the same header may be copied right behind it: what
/// the usual case of small messages needs to know, in one place. Whatever else happens to an outbox
/// closes it first, so nothing else has to. Thread safety: one shard. Ownership: none; lane, entry
/// and memory are the outbox's.
struct OpenRun {
  std::uint32_t room = 0;        ///< bytes that may yet come; 0: closed
  std::uint32_t attributes = 0;  ///< of its frames: kind, flags, hops, lane
  std::uint64_t addresses = 0;   ///< dst and src
  std::byte* end = nullptr;      ///< where the next frame goes
  LaneQueue* lane = nullptr;
  Entry* entry = nullptr;

  /// Frames may come behind the last entry of the lane, as far as the chunk and a lane of
  /// `bytes_max` have room. REQUIRES: the entry ends where the chunk does.
  void open(LaneQueue& of, const CopyChunk& chunk, std::uint64_t bytes_max);
  /// May `size` bytes of frames with one header come behind it? REQUIRES: size is not 0.
  [[nodiscard]] bool takes(const std::byte* frames, std::uint32_t size) const {
    return size <= room && load_le<std::uint64_t>(frames + proto::kAddressesOffset) == addresses &&
           load_le<std::uint32_t>(frames + proto::kAttributesOffset) == attributes;
  }
  /// REQUIRES: takes().
  void append(const std::byte* frames, std::uint32_t size, std::uint32_t count) {
    copy(end, frames, size);
    end += size;
    room -= size;
    lane->extend(*entry, size, count);
  }
  void close() { room = 0; }

 private:
  /// The C library's memcpy() beats this from some hundred bytes on; below that the call is most of
  /// its cost (bench/hub/data/egress/outbox_bench.cpp). REQUIRES: at least the 16 bytes of a
  /// header.
  static void copy(std::byte* to, const std::byte* from, std::uint32_t size) {
    if (size > kInlineBytesMax) {
      std::memcpy(to, from, size);
      return;
    }
    // The last piece may overlap the one before it: no byte beyond the frames is read or written.
    // Straight on: as a loop it costs a tenth of a small frame more.
    std::memcpy(to, from, kPiece);
    std::memcpy(to + size - kPiece, from + size - kPiece, kPiece);
    if (size <= 2 * kPiece) return;
    std::memcpy(to + kPiece, from + kPiece, kPiece);
    std::memcpy(to + size - 2 * kPiece, from + size - 2 * kPiece, kPiece);
  }
  static constexpr std::uint32_t kPiece = 16;
  static constexpr std::uint32_t kInlineBytesMax = 64;
};

/// Memory into which one outbox copies frames, one behind the other. A new chunk is larger than the
/// one before it while much is copied. Thread safety: one shard. Ownership: a reference to the
/// chunk, as each copy has one.
class CopyChunk {
 public:
  /// `waits`: something waits in the outbox, so that the copy may stay there for long, and counts
  /// against `budget`.
  [[nodiscard]] Run copy(const Run& run, bool waits, BudgetLease& budget, EgressContext& context);
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
