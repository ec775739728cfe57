#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>

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

/// Frames that were written and not confirmed, by their count in this epoch (docs/protocol.md,
/// section 3, Resume). Thread safety: guarded by its owner.
class RetainedFrames {
 public:
  explicit RetainedFrames(std::size_t bytes_max) : bytes_max_(bytes_max) {}

  /// Frames that were written just now; `keep` false only counts them.
  void written(FrameRun run, bool keep);
  /// `upcoming`: frames handed to the kernel by a write whose written() comes later; a confirmation
  /// may overtake it.
  [[nodiscard]] bool confirm(std::uint64_t count, std::uint64_t upcoming);

  /// Whether `more` bytes may be kept in addition; lets frames at the front go that were not sent
  /// with BLOCK.
  [[nodiscard]] bool make_room(std::size_t more);

  /// The peer took `peer_taken` frames: takes out what came after, to be sent again, and sets the
  /// count back to the first of these. Returns how many frames before it are missing; nothing: more
  /// than were written.
  [[nodiscard]] std::optional<std::uint64_t> take_after(std::uint64_t peer_taken,
                                                        std::deque<FrameRun>& again);
  /// Counts begin at 0.
  void restart();

  [[nodiscard]] std::size_t bytes() const { return bytes_; }
  [[nodiscard]] std::uint64_t next_count() const { return next_; }
  [[nodiscard]] std::uint64_t let_go() const { return let_go_; }

 private:
  [[nodiscard]] std::uint64_t first() const { return next_ - frames_; }
  void drop_front(std::uint64_t count);

  const std::size_t bytes_max_;
  std::deque<FrameRun> runs_;  ///< Limit: bytes_max_
  std::size_t bytes_ = 0;
  std::uint64_t frames_ = 0;  ///< in runs_
  std::uint64_t next_ = 0;    ///< count of the next frame that is written
  std::uint64_t confirmed_ = 0;
  std::uint64_t let_go_ = 0;
};

}  // namespace gimnet::nif
