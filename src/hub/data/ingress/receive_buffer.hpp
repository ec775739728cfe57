#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "hub/data/buffer_pool.hpp"
#include "hub/data/tally.hpp"

namespace gimnet::hub {

/// The frame that a connection has begun and not finished, or the rest of a read: whole frames that
/// wait for their turn. It lies in a buffer that only this connection uses, or, if it is short, in
/// a copy.
struct FrameTail {
  BufferRef buffer;
  std::uint32_t begin = 0;
  std::uint32_t size = 0;
  std::uint32_t needed = 0;  ///< bytes of the whole frame, as far as known; 0: it is a rest
  bool own = false;          ///< read on behind it: nobody else reads into that buffer

  [[nodiscard]] bool empty() const { return size == 0; }
  /// It begins with a whole frame; nothing is read before it was handed on.
  [[nodiscard]] bool is_rest() const { return size != 0 && needed == 0; }
};

/// The memory that the connections of a shard read into: one slab for all of them. It is rewound
/// while nobody keeps a reference, so it stays in the cache. A large frame that ends in a later
/// read stays where it began, and its connection goes on reading behind it: no payload byte is
/// moved. If many large frames are begun at a time, their senders are slow. Then each further frame
/// moves once into memory of its own size. Thread safety: one shard.
class ReceiveBuffer {
 public:
  /// tail_bytes_max: what all begun frames together may keep.
  ReceiveBuffer(BufferPool& pool, Tally& tally, std::uint64_t tail_bytes_max)
      : pool_(pool), tally_(tally), tail_bytes_max_(tail_bytes_max) {}

  /// The memory for the next read of the connection with that tail.
  [[nodiscard]] std::span<std::byte> prepare(FrameTail& tail);

  struct Received {
    const std::byte* begin = nullptr;  ///< the tail, and what came behind it
    const std::byte* end = nullptr;
  };
  /// `bytes` were read into what prepare() gave; the tail is part of it now.
  [[nodiscard]] Received commit(FrameTail& tail, std::size_t bytes);
  /// The buffer that holds what commit() returned, to take references of.
  [[nodiscard]] const BufferRef& buffer() const { return reading_; }

  /// After all whole frames were handed on: [begin, end) of buffer() is left over, the start of a
  /// frame of `needed` bytes. Returns false if too much is kept for begun frames already; nothing
  /// is kept then.
  [[nodiscard]] bool keep(FrameTail& tail, const std::byte* begin, const std::byte* end,
                          std::uint32_t needed);
  /// Instead: [begin, end) of buffer() begins with a whole frame, and is left for a later turn.
  void keep_rest(FrameTail& tail, const std::byte* begin, const std::byte* end);
  /// That turn. REQUIRES: tail.is_rest(). `tail` is empty then, as after commit().
  [[nodiscard]] Received go_on(FrameTail& tail);
  /// Rests that are kept, and their bytes. A connection reads nothing while it has one, and little
  /// while they are more than kRestBytesMax, so that they are no more than that and a read each.
  [[nodiscard]] std::size_t rests() const { return rests_; }
  [[nodiscard]] bool many_rests() const { return rest_bytes_ >= kRestBytesMax; }
  static constexpr std::uint64_t kRestBytesMax = std::uint64_t{16} << 20;
  /// Connections that have a slab to themselves for a begun frame.
  [[nodiscard]] std::size_t own_slabs() const { return own_slabs_; }
  /// The connection is gone.
  void forget(FrameTail& tail);

 private:
  /// A begun frame up to this size is copied; keeping a slab for it would cost more than that.
  static constexpr std::uint32_t kCopyTailBytes = 1024;
  /// Of a frame from here on no payload byte is copied, as long as there is a slab to leave it in.
  static constexpr std::uint32_t kLargeFrameBytes = kSharedChunkBytes;
  /// So many connections may have a slab to themselves.
  static constexpr std::size_t kOwnSlabsMax = 16;
  /// A slab with less room than this is not read into any more.
  static constexpr std::uint32_t kLeastRoom = 64 * 1024;

  /// Makes sure of a slab with room behind used_.
  void make_room();
  [[nodiscard]] static bool owns_slab(const FrameTail& tail);
  [[nodiscard]] static std::uint32_t cost(const FrameTail& tail);

  BufferPool& pool_;
  Tally& tally_;
  const std::uint64_t tail_bytes_max_;
  BufferRef slab_;
  std::uint32_t used_ = 0;   ///< bytes of slab_ that may still be referenced
  BufferRef reading_;        ///< of the read that is under way
  std::uint32_t begin_ = 0;  ///< where its bytes begin
  std::uint64_t tail_bytes_ = 0;
  std::size_t own_slabs_ = 0;
  std::uint64_t rest_bytes_ = 0;
  std::size_t rests_ = 0;
};

}  // namespace gimnet::hub
