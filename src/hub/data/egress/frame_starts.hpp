#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "hub/data/egress/run.hpp"

namespace gimnet::hub {

/// The first frames of a run.
struct Leading {
  std::uint32_t frames = 0;
  std::uint32_t size = 0;
};

/// Where the frames begin of long runs that are not all equally long: looked for once, and then
/// found by bisection for every queue that drops of the same run, so that one with many subscribers
/// costs each of them little. Keeps the runs' buffers until forget(): nobody writes over their
/// bytes. Thread safety: one shard. Memory: none before the first such run, at most kStretches *
/// kFramesMax * 4 bytes.
class FrameStarts {
 public:
  /// The starts of one run and of whatever is left of it.
  class Stretch {
   public:
    /// So many. REQUIRES: the run was asked for, and has more.
    [[nodiscard]] Leading leading_frames(const Run& run, std::uint32_t frames) const;
    /// As few as come to `bytes` or more. REQUIRES: the run was asked for, and is longer than that.
    [[nodiscard]] Leading leading_from(const Run& run, std::uint64_t bytes) const;
    /// As many as come to `bytes` or less. REQUIRES: as leading_from().
    [[nodiscard]] Leading leading_within(const Run& run, std::uint64_t bytes) const;
    /// REQUIRES: the run was asked for.
    [[nodiscard]] const std::byte* last(const Run& run) const;

   private:
    friend class FrameStarts;
    [[nodiscard]] bool holds(const Run& run) const {
      return buffer_.get() == run.buffer.get() && buffer_ && run.bytes >= begin_ &&
             run.bytes + run.size <= begin_ + size_;
    }
    [[nodiscard]] std::size_t index_of(const Run& run) const;
    void find(const Run& run);

    BufferRef buffer_;
    const std::byte* begin_ = nullptr;
    std::uint32_t size_ = 0;
    std::vector<std::uint32_t> starts_;  ///< from begin_, ascending
  };

  /// nullptr: it is too short to be worth it, or longer than any that comes from one read. Valid
  /// until: the next call.
  [[nodiscard]] const Stretch* find(const Run& run);
  /// The turn is over.
  void forget() {
    if (used_ != 0) let_go();
  }

  static constexpr std::uint32_t kFramesMin = 32;
  /// The smallest frames in the largest buffer.
  static constexpr std::uint32_t kFramesMax = 384 * 1024 / 16;
  /// Queues that have been full for as long drop of the same runs: the one that comes, and one or
  /// two old ones.
  static constexpr std::size_t kStretches = 4;

 private:
  void let_go();

  std::array<Stretch, kStretches> stretches_;
  std::size_t used_ = 0;
  std::size_t next_ = 0;
};

}  // namespace gimnet::hub
