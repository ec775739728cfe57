#pragma once

#include <cstdint>
#include <vector>

#include "base/check.hpp"
#include "hub/data/egress/run.hpp"

namespace gimnet::hub {

/// The starts of the last frames of a run. All starts are looked for when the first subscription
/// asks for more than one frame, once for all subscriptions. Thread safety: one shard. Memory: 4
/// bytes for each frame of the longest run.
class LastFrames {
 public:
  /// The next run, of which the last frame has `last_bytes`. Valid until: the run's bytes go, or
  /// the next call.
  void begin(const Run& run, std::uint32_t last_bytes) {
    bytes_ = run.bytes;
    size_ = run.size;
    last_bytes_ = last_bytes;
    starts_.clear();
  }
  /// Bytes of the last `frames` frames. REQUIRES: 0 < frames; the run has so many.
  [[nodiscard]] std::uint32_t bytes_of(std::uint32_t frames) {
    if (frames == 1) return last_bytes_;
    if (starts_.empty()) find();
    GIMNET_ASSERT(frames <= starts_.size());
    return size_ - starts_[starts_.size() - frames];
  }

 private:
  void find() {
    for (std::uint32_t start = 0; start != size_;) {
      starts_.push_back(start);
      start += static_cast<std::uint32_t>(proto::load_header(bytes_ + start).frame_size());
    }
  }

  const std::byte* bytes_ = nullptr;
  std::uint32_t size_ = 0;
  std::uint32_t last_bytes_ = 0;
  std::vector<std::uint32_t> starts_;  ///< ascending; empty: nobody asked
};

}  // namespace gimnet::hub
