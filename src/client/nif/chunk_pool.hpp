#pragma once

#include <algorithm>
#include <cstddef>
#include <deque>
#include <memory>

namespace gimnet::nif {

/// A block of memory that frames are written into one after the other.
struct Chunk {
  explicit Chunk(std::size_t bytes) : memory(new std::byte[bytes]), capacity(bytes) {}
  std::unique_ptr<std::byte[]> memory;
  std::size_t capacity;
  std::size_t used = 0;
};

/// Hands out chunks and takes those back that nobody refers to any more, so that a steady stream
/// allocates nothing. Thread safety: guarded by its owner, and so are all references to its chunks.
class ChunkPool {
 public:
  static constexpr std::size_t kChunkBytes = 128 * 1024;

  /// An empty chunk of at least `bytes`. May throw std::bad_alloc.
  [[nodiscard]] std::shared_ptr<Chunk> take(std::size_t bytes) {
    if (bytes <= kChunkBytes && !chunks_.empty() && chunks_.front().use_count() == 1) {
      std::shared_ptr<Chunk> chunk = std::move(chunks_.front());
      chunks_.pop_front();
      chunk->used = 0;
      chunks_.push_back(chunk);
      return chunk;
    }
    auto chunk = std::make_shared<Chunk>(std::max(bytes, kChunkBytes));
    if (bytes <= kChunkBytes && chunks_.size() < kKept) chunks_.push_back(chunk);
    return chunk;
  }

 private:
  static constexpr std::size_t kKept = 16;

  std::deque<std::shared_ptr<Chunk>>
      chunks_;  ///< the one handed out longest ago is first. Limit: kKept
};

}  // namespace gimnet::nif
