#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>

#include "hub/data/buffer.hpp"
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

}  // namespace gimnet::hub
