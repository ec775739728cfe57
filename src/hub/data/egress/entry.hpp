#pragma once

#include <cstdint>
#include <utility>

#include "hub/data/egress/piece_pool.hpp"
#include "hub/data/egress/run.hpp"

namespace gimnet::hub {

/// An element of a lane: a run of whole messages, or the fragments of one message. All its frames
/// have the same dst, src, kind, flags and lane.
struct Entry {
  Run run;
  PieceRef more;
  MorePieces* last = nullptr;
  std::uint32_t size = 0;  ///< of all pieces
  std::uint32_t frames =
      0;  ///< of all pieces; 0: this entry was dropped or replaced and is skipped
  std::uint32_t message_number = 0;  ///< of a fragmented message
  std::uint8_t source = 0;  ///< its place in the lane's SourceBytes, once those are counted
  bool fragmented = false;
  bool complete = true;   ///< the last fragment is here
  bool touched = false;   ///< a fragment of it was handed to the kernel: it is finished
  bool block = false;     ///< never dropped for room
  bool latest = false;    ///< replaced by a newer message of its stream
  bool extended = false;  ///< has EXT: looked at when its turn comes
  bool shared = false;    ///< fanned out to many: stays a reference while it waits

  /// `run` with that header, to be sent as the header asks. `shared`: fanned out to many.
  [[nodiscard]] static Entry of(Run run, const proto::FrameHeader& header, bool shared) {
    Entry entry;
    entry.size = run.size;
    entry.frames = run.frames;
    entry.run = std::move(run);
    entry.block = proto::is_block(header);
    entry.latest = header.policy() == proto::Policy::latest;
    entry.extended = header.has(proto::kFlagExt);
    entry.shared = shared;
    if (header.has(proto::kFlagFragment)) entry.note_fragment();
    return entry;
  }
  /// Messages of which the end is in it.
  [[nodiscard]] std::uint32_t messages() const { return fragmented ? (complete ? 1 : 0) : frames; }
  /// It goes to one node, by its id or as the one that accepts a service.
  [[nodiscard]] bool is_addressed() const {
    const proto::Kind kind = run.header().kind;
    return kind == proto::Kind::unicast || kind == proto::Kind::service;
  }
  void append(Run piece, PiecePool& pool) {
    size += piece.size;
    frames += piece.frames;
    Run& tail = last != nullptr ? last->run : run;
    if (tail.extend(piece)) return;
    PieceRef node = pool.take(std::move(piece));
    MorePieces* raw = node.get();
    (last != nullptr ? last->next : more) = std::move(node);
    last = raw;
  }
  /// Makes the next piece the first. Returns false if there is none.
  bool next_piece() {
    if (!more) return false;
    PieceRef node = std::move(more);
    run = std::move(node->run);
    more = std::move(node->next);
    if (!more) last = nullptr;
    return true;
  }

 private:
  /// Reads where the frame stands in its message.
  void note_fragment();
};

}  // namespace gimnet::hub
