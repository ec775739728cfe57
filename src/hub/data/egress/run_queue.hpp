#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>

#include "hub/data/egress/run.hpp"
#include "hub/data/ring_queue.hpp"

namespace gimnet::hub {

/// Frames that wait to be written to one connection ahead of all lanes, in the order in which they
/// came: control frames, or those that an earlier connection did not bring. Thread safety: one
/// shard. Ownership: references to buffers.
class RunQueue {
 public:
  /// Joined to the last run where it lies right behind it.
  void push(Run run) {
    bytes_ += run.size;
    if (runs_.empty() || !runs_.back().extend(run)) runs_.push_back(std::move(run));
  }
  /// The same for frames that do not count in counted_bytes(). They come before any that do.
  void push_uncounted(Run run) {
    uncounted_bytes_ += run.size;
    push(std::move(run));
  }
  [[nodiscard]] bool empty() const { return runs_.empty(); }
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }
  [[nodiscard]] std::uint64_t counted_bytes() const { return bytes_ - uncounted_bytes_; }

  /// For the one that takes them out, and says with on_left() how many bytes left.
  [[nodiscard]] RingQueue<Run>& runs() { return runs_; }
  void on_left(std::uint32_t bytes) {
    bytes_ -= bytes;
    uncounted_bytes_ -= std::min<std::uint64_t>(bytes, uncounted_bytes_);
  }
  void clear() {
    runs_.clear();
    bytes_ = uncounted_bytes_ = 0;
  }
  /// Nothing was written for a while: gives back memory that only a busy connection needs.
  void trim() { runs_.trim(); }

 private:
  RingQueue<Run> runs_;
  std::uint64_t bytes_ = 0;
  std::uint64_t uncounted_bytes_ = 0;
};

}  // namespace gimnet::hub
