#pragma once

#include <cstddef>
#include <cstdint>

#include "hub/data/buffer.hpp"
#include "proto/frame/frame_header.hpp"

namespace gimnet::hub {

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
  /// The first `first_frames` of it, which this run loses. REQUIRES: they have `first_size` bytes.
  [[nodiscard]] Run take_front(std::uint32_t first_frames, std::uint32_t first_size) {
    Run front{buffer.share(), bytes, first_size, first_frames};
    bytes += first_size;
    size -= first_size;
    frames -= first_frames;
    return front;
  }
  /// Extends this run by `next` if that lies right behind it in the same buffer.
  bool extend(const Run& next) {
    if (buffer.get() != next.buffer.get() || bytes + size != next.bytes) return false;
    size += next.size;
    frames += next.frames;
    return true;
  }
};

}  // namespace gimnet::hub
