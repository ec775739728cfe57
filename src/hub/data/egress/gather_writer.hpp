#pragma once

#include <array>
#include <cstdint>

#include "hub/data/egress/egress_context.hpp"
#include "hub/data/egress/outbox.hpp"
#include "hub/data/egress/resume_buffer.hpp"
#include "net/stream.hpp"

namespace gimnet::hub {

enum class Flush : std::uint8_t {
  emptied,  ///< everything was taken
  blocked,  ///< the transport takes no more now
  waits,    ///< the resume buffer is full of frames sent with BLOCK: go on after a CONFIRM
  more,     ///< the turn's share is used up, and more could be written
  failed,   ///< the connection is broken
};

/// Writes an outbox: many frames, one gathered write. Order: a frame begun before, control, frames
/// of an earlier connection, then lanes by number, where a waiting lane gets at least 1/16 of the
/// bytes. What the transport does not take stays in its lane, where it can still be overtaken,
/// replaced or dropped; but for a frame partly written. Thread safety: one shard. One per
/// connection.
class GatherWriter {
 public:
  /// `resume` is nullptr where the connection has no resume. Frames that were taken count as
  /// delivered, or go to `resume`.
  [[nodiscard]] Flush flush(Outbox& outbox, ResumeBuffer* resume, net::Stream& transport,
                            EgressContext& context);

  [[nodiscard]] bool in_frame() const { return partial_.run.frames != 0; }
  /// A frame partly written makes its reader slow, but for one that a newer message may replace.
  [[nodiscard]] bool in_stale_frame() const {
    return in_frame() && partial_.run.header().policy() != proto::Policy::latest;
  }
  /// The connection broke: the frame partly written, whole, or an empty run.
  [[nodiscard]] Run take_partial();

 private:
  static constexpr std::size_t kPiecesMax = 64;
  static constexpr std::size_t kPicksMax = 256;
  static constexpr std::size_t kBatchBytes = 256 * 1024;
  static constexpr int kBatchesPerTurn = 4;

  /// The origin of a piece of a batch.
  enum class Source : std::uint8_t { partial, control, replay, lane0, lane1, lane2, lane3 };
  struct Pick {
    Source source;
    std::uint32_t bytes;
  };
  struct Batch {
    std::array<iovec, kPiecesMax> pieces;
    std::array<Pick, kPicksMax> picks;
    std::size_t piece_count = 0;
    std::size_t pick_count = 0;
    std::size_t bytes = 0;

    [[nodiscard]] bool full() const {
      return piece_count == kPiecesMax || pick_count == kPicksMax || bytes >= kBatchBytes;
    }
    void add(Source source, const std::byte* begin, std::uint32_t size);
  };
  /// The next piece of a lane that this batch has not taken yet.
  struct LaneCursor {
    std::uint64_t number = 0;
    const MorePieces* more = nullptr;  ///< the piece after `run`
    const Run* run = nullptr;          ///< nullptr: nothing left
  };
  struct Partial {
    Run run;                   ///< one frame
    std::uint32_t offset = 0;  ///< bytes of it that were written
    bool control = false;
    bool shared = false;
  };
  struct Job {
    Outbox& outbox;
    ResumeBuffer* resume;
    EgressContext& context;
  };

  void gather(Batch& batch, Job& job);
  void gather_queue(Batch& batch, Source source, RingQueue<Run>& queue, Job& job);
  void gather_lanes(Batch& batch, Job& job);
  static void gather_lane(Batch& batch, std::size_t lane, LaneCursor& cursor, Job& job);
  static void load(LaneCursor& cursor, std::size_t lane, Job& job);
  static void advance(LaneCursor& cursor, std::size_t lane, Job& job);
  [[nodiscard]] static std::size_t choose_lane(std::array<LaneCursor, proto::kLaneCount>& cursors,
                                               Outbox& outbox);
  static void owe(std::size_t lane, std::uint32_t bytes,
                  std::array<LaneCursor, proto::kLaneCount>& cursors, Outbox& outbox);
  /// The bytes of the run that may be written: all of it, or as much as the resume buffer has room
  /// for.
  [[nodiscard]] static std::uint32_t allowed(const Run& run, std::size_t planned, Job& job);

  void consume(const Batch& batch, std::size_t bytes, Job& job);
  void consume_partial(std::size_t bytes, Job& job);
  [[nodiscard]] std::uint32_t consume_run(Run& run, std::size_t bytes, bool control, bool shared,
                                          Job& job);
  void consume_queue(RunQueue& queue, std::size_t bytes, bool control, Job& job);
  void consume_lane(std::size_t lane, std::size_t bytes, Job& job);
  static void finish(Run run, bool control, bool shared, Job& job);
  static void keep_in_pieces(Run run, bool shared, Job& job);

  Partial partial_;
};

}  // namespace gimnet::hub
