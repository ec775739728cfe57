#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "hub/data/buffer.hpp"
#include "proto/frame/frame_header.hpp"

namespace gimnet::hub {

/// Complete frames that lie one behind the other in one buffer, all with the same header but for the length.
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
  /// Extends this run by `next` if that lies right behind it in the same buffer.
  bool extend(const Run& next) {
    if (buffer.get() != next.buffer.get() || bytes + size != next.bytes) return false;
    size += next.size;
    frames += next.frames;
    return true;
  }
};

/// More of a fragmented message: what did not lie behind its first piece.
struct MorePieces {
  Run run;
  std::unique_ptr<MorePieces> next;
};

/// What waits in a lane: a run of whole messages, or the fragments of one message. All its frames have the same dst,
/// src, kind, flags and lane.
struct Entry {
  Run run;
  std::unique_ptr<MorePieces> more;
  MorePieces* last = nullptr;
  std::uint32_t size = 0;            ///< of all pieces
  std::uint32_t frames = 0;          ///< of all pieces; 0: this entry was dropped or replaced and is skipped
  std::uint32_t message_number = 0;  ///< of a fragmented message
  bool fragmented = false;
  bool complete = true;   ///< the last fragment is here
  bool touched = false;   ///< a fragment of it was handed to the kernel: it is finished
  bool block = false;     ///< never dropped for room
  bool latest = false;    ///< replaced by a newer message of its stream
  bool extended = false;  ///< has EXT: looked at when its turn comes
  bool shared = false;    ///< fanned out to many: stays a reference while it waits

  void append(Run piece) {
    size += piece.size;
    frames += piece.frames;
    Run& tail = last != nullptr ? last->run : run;
    if (tail.extend(piece)) return;
    auto node = std::make_unique<MorePieces>();
    node->run = std::move(piece);
    MorePieces* raw = node.get();
    (last != nullptr ? last->next : more) = std::move(node);
    last = raw;
  }
  /// Makes the next piece the first. Returns false if there is none.
  bool next_piece() {
    if (!more) return false;
    std::unique_ptr<MorePieces> node = std::move(more);
    run = std::move(node->run);
    more = std::move(node->next);
    if (!more) last = nullptr;
    return true;
  }
};

}  // namespace gimnet::hub
