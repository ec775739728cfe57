#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>

#include "proto/frame/frame_header.hpp"

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

/// Neighbouring whole frames in one chunk. A value type; keeps its chunk.
struct FrameRun {
  enum class Sort : std::uint8_t {
    data,    ///< counted, kept for resume
    latest,  ///< one data frame that a newer one of its stream may replace
    resent,  ///< data frames that were counted before the break
    control  ///< FLOW and kinds from 16 on: for this connection only
  };
  std::shared_ptr<Chunk> chunk;
  std::size_t begin = 0;
  std::size_t end = 0;
  std::uint32_t frames = 0;
  std::uint8_t lane = 0;
  Sort sort = Sort::data;

  [[nodiscard]] std::size_t size() const { return end - begin; }
  [[nodiscard]] const std::byte* bytes() const { return chunk->memory.get() + begin; }
  [[nodiscard]] std::byte* bytes() { return chunk->memory.get() + begin; }
  [[nodiscard]] bool counted() const { return sort != Sort::control; }
  [[nodiscard]] proto::FrameHeader first_header() const { return proto::load_header(bytes()); }
  [[nodiscard]] std::size_t first_size() const { return first_header().frame_size(); }

  template <class Change>
  void change_headers(Change change) {
    for (std::size_t at = 0; at < size();) {
      proto::FrameHeader header = proto::load_header(bytes() + at);
      change(header);
      proto::store_header(bytes() + at, header);
      at += header.frame_size();
    }
  }

  /// Takes `count` frames of `size` bytes together from the front into a run of their own.
  /// REQUIRES: they are there.
  FrameRun split(std::size_t size, std::uint32_t count) {
    FrameRun front = *this;
    front.end = begin + size;
    front.frames = count;
    begin += size;
    frames -= count;
    return front;
  }

  /// Extends this run by `next` if that lies right behind it and is of the same sort.
  bool extend(const FrameRun& next) {
    if (chunk != next.chunk || end != next.begin || lane != next.lane || sort != next.sort)
      return false;
    end = next.end;
    frames += next.frames;
    return true;
  }

  /// Takes as many frames as fit into `bytes_max`, at least one.
  FrameRun split_at_most(std::size_t bytes_max) {
    if (size() <= bytes_max) return split(size(), frames);
    std::size_t taken = first_size();
    std::uint32_t count = 1;
    while (count < frames) {
      const std::size_t next = proto::load_header(bytes() + taken).frame_size();
      if (taken + next > bytes_max) break;
      taken += next;
      ++count;
    }
    return split(taken, count);
  }

  /// Takes the frames that end at or before `offset`; maybe none.
  FrameRun split_whole_before(std::size_t offset) {
    if (first_size() > offset) return split(0, 0);
    return split_at_most(offset);
  }
};

}  // namespace gimnet::nif
