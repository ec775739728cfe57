#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "hub/data/buffer.hpp"
#include "hub/data/ring_queue.hpp"
#include "proto/frame/frame_header.hpp"

namespace gimnet::hub {

/// The first frames of a run.
struct Leading {
  std::uint32_t frames = 0;
  std::uint32_t size = 0;
};

/// Complete frames that lie one behind the other in one buffer, all with the same header but for
/// the length.
struct Run {
  BufferRef buffer;
  const std::byte* bytes = nullptr;
  std::uint32_t size = 0;
  std::uint32_t frames = 0;

  [[nodiscard]] proto::FrameHeader header() const { return proto::load_header(bytes); }
  [[nodiscard]] Run share() const { return Run{buffer.share(), bytes, size, frames}; }
  /// Lets the first frame go; returns its size.
  std::uint32_t skip_frame() {
    const auto frame = static_cast<std::uint32_t>(header().frame_size());
    bytes += frame;
    size -= frame;
    --frames;
    return frame;
  }
  /// The first frame, which this run loses.
  [[nodiscard]] Run take_frame() {
    Run frame = share();
    frame.size = skip_frame();
    frame.frames = 1;
    return frame;
  }
  /// The frames at the front for which takes(those before, bytes of the next one) is true.
  template <class Takes>
  [[nodiscard]] Leading leading(Takes&& takes) const {
    Leading front;
    while (front.frames != frames) {
      const auto next =
          static_cast<std::uint32_t>(proto::load_header(bytes + front.size).frame_size());
      if (!takes(std::as_const(front), next)) break;
      front.size += next;
      ++front.frames;
    }
    return front;
  }
  /// The frames at the front, which this run loses.
  [[nodiscard]] Run take_front(const Leading& front) {
    Run taken{buffer.share(), bytes, front.size, front.frames};
    bytes += front.size;
    size -= front.size;
    frames -= front.frames;
    return taken;
  }
  /// Extends this run by `next` if that lies right behind it in the same buffer.
  bool extend(const Run& next) {
    if (buffer.get() != next.buffer.get() || bytes + size != next.bytes) return false;
    size += next.size;
    frames += next.frames;
    return true;
  }
};

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
