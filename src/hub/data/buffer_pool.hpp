#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "hub/data/budget.hpp"
#include "hub/data/buffer.hpp"

namespace gimnet::hub {

/// Slab bytes in which a read may begin; the frame that is begun there ends in the room behind it.
inline constexpr std::uint32_t kSlabReadBytes = 256 * 1024;

/// The buffers of one shard. Memory that was used once is kept for the next time, within limits, so
/// that after a warm-up no turn allocates. Thread safety: none; one shard (lend() and the end of a
/// loan cross shards by an atomic). Ownership: owns every buffer; must outlive all references.
class BufferPool {
 public:
  /// frame_bytes: the largest `length` of a frame.
  BufferPool(std::uint32_t frame_bytes, BudgetLease& budget);
  ~BufferPool();
  BufferPool(const BufferPool&) = delete;
  BufferPool& operator=(const BufferPool&) = delete;

  [[nodiscard]] BufferRef take_slab();
  [[nodiscard]] std::uint64_t slab_bytes() const { return slab_bytes_; }
  /// A chunk of at least `bytes`. Up to the largest frame with its header it is kept for the next
  /// time.
  [[nodiscard]] BufferRef take_chunk(std::uint32_t bytes);
  /// A chunk of exactly `bytes`, which is freed after its use: for what is kept long, and where
  /// memory is scarce. From kExactBytesMin on a chunk of the next class could be 3.5 times as
  /// large.
  static constexpr std::uint32_t kExactBytesMin = 4 * 1024;
  [[nodiscard]] BufferRef take_exact(std::uint32_t bytes);

  /// Counts a loan of the memory behind `buffer`, for one mailbox entry, and returns its owner. The
  /// bytes stay until the borrowing shard has called adopt() and let its reference go, or
  /// end_loan().
  [[nodiscard]] static Buffer* lend(Buffer& buffer);
  /// On the borrowing shard: a reference that ends the loan when it is let go. Loans of one buffer
  /// that follow each other become one buffer, so that it is counted once and neighbouring frames
  /// in it are seen to be neighbours.
  [[nodiscard]] BufferRef adopt(Buffer* lent);
  static void end_loan(Buffer* lent);

  /// Counts the buffer against `payer` until it is free again; once, however many frames keep it.
  void pin(Buffer& buffer, BudgetLease& payer);
  /// No waiting frame keeps it any more, though somebody else does.
  void unpin(Buffer& buffer);
  [[nodiscard]] std::uint64_t pinned_bytes() const { return pinned_bytes_; }

  void recycle(Buffer& buffer);
  /// Now and then: keeps or frees what other shards have let go meanwhile.
  void take_back_lent();
  /// While memory is scarce: frees kept buffers. Other sizes are used then, and these would stay
  /// beside the budget.
  void free_kept();
  /// Free here, and still read by other shards when last looked at.
  [[nodiscard]] std::size_t lent_buffers() const { return lent_.size(); }
  /// Bytes of free chunks that wait for their next use.
  [[nodiscard]] std::size_t kept_chunk_bytes() const;

 private:
  static constexpr std::uint8_t kUnpooled = 0xFF;
  /// As many slabs as a full mailbox of another shard (16 MiB unless configured) keeps on their
  /// way; with fewer, each round trip of a burst between shards would free slabs and allocate them
  /// again.
  static constexpr std::size_t kFreeSlabsMax = 64;
  static constexpr std::size_t kFreeChunkBytesMax = std::size_t{8} << 20;
  /// While memory is scarce: enough for the reads of some turns.
  static constexpr std::size_t kScarceSlabsMax = 4;
  static constexpr std::size_t kScarceChunkBytesMax = std::size_t{256} << 10;

  struct FreeList {
    Buffer* head = nullptr;
    std::size_t count = 0;
    void push(Buffer& buffer);
    [[nodiscard]] Buffer* pop();
  };

  [[nodiscard]] Buffer* allocate(std::uint32_t capacity, BufferKind kind);
  static void free_buffer(Buffer* buffer);
  void keep_or_free(Buffer& buffer);
  [[nodiscard]] std::size_t free_slabs_max() const {
    return budget_.scarce() ? kScarceSlabsMax : kFreeSlabsMax;
  }
  [[nodiscard]] std::size_t free_chunk_bytes_max() const {
    return budget_.scarce() ? kScarceChunkBytesMax : kFreeChunkBytesMax;
  }

  const std::uint32_t slab_bytes_;
  const std::array<std::uint32_t, 5> chunk_bytes_;
  BudgetLease& budget_;
  FreeList free_slabs_;
  FreeList free_foreign_;
  std::vector<Buffer*> adopted_;  ///< foreign buffers in use, the last one of each lending pool
  std::array<FreeList, 5> free_chunks_;  ///< by size, as chunk_bytes_
  std::vector<Buffer*> lent_;            ///< free here, still read by another shard
  std::uint64_t pinned_bytes_ = 0;
};

}  // namespace gimnet::hub
