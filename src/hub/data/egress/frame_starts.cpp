#include "hub/data/egress/frame_starts.hpp"

#include <algorithm>

namespace gimnet::hub {

std::size_t FrameStarts::Stretch::index_of(const Run& run) const {
  const auto offset = static_cast<std::uint32_t>(run.bytes - begin_);
  return static_cast<std::size_t>(std::lower_bound(starts_.begin(), starts_.end(), offset) -
                                  starts_.begin());
}

Leading FrameStarts::Stretch::leading_frames(const Run& run, std::uint32_t frames) const {
  const std::size_t first = index_of(run);
  return {frames, starts_[first + frames] - starts_[first]};
}

Leading FrameStarts::Stretch::leading_from(const Run& run, std::uint64_t bytes) const {
  const auto first = starts_.begin() + static_cast<std::ptrdiff_t>(index_of(run));
  // The start of the frame behind those that are looked for; behind the run's last one there may be
  // none.
  const auto behind = std::lower_bound(first + 1, first + run.frames, *first + bytes);
  const auto frames = static_cast<std::uint32_t>(behind - first);
  return {frames, frames == run.frames ? run.size : *behind - *first};
}

Leading FrameStarts::Stretch::leading_within(const Run& run, std::uint64_t bytes) const {
  const auto first = starts_.begin() + static_cast<std::ptrdiff_t>(index_of(run));
  const auto behind = std::upper_bound(first, first + run.frames, *first + bytes) - 1;
  return {static_cast<std::uint32_t>(behind - first), *behind - *first};
}

const std::byte* FrameStarts::Stretch::last(const Run& run) const {
  return begin_ + starts_[index_of(run) + run.frames - 1];
}

void FrameStarts::Stretch::find(const Run& run) {
  buffer_ = run.buffer.share();
  begin_ = run.bytes;
  size_ = run.size;
  starts_.reserve(kFramesMax);
  starts_.clear();
  for (std::uint32_t start = 0; start != run.size;) {
    starts_.push_back(start);
    start += static_cast<std::uint32_t>(proto::load_header(run.bytes + start).frame_size());
  }
}

const FrameStarts::Stretch* FrameStarts::find(const Run& run) {
  if (run.frames < kFramesMin || run.frames > kFramesMax) return nullptr;
  for (std::size_t i = 0; i < used_; ++i) {
    if (stretches_[i].holds(run)) return &stretches_[i];
  }
  Stretch& stretch = stretches_[next_];
  next_ = (next_ + 1) % kStretches;
  used_ = std::max(used_, next_ == 0 ? kStretches : next_);
  stretch.find(run);
  return &stretch;
}

void FrameStarts::let_go() {
  for (Stretch& stretch : stretches_) stretch.buffer_.reset();
  used_ = next_ = 0;
}

}  // namespace gimnet::hub
