#pragma once

#include <sys/uio.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <unordered_map>

#include "client/nif/frame_run.hpp"
#include "proto/frame/frame_header.hpp"

namespace gimnet::nif {

/// The stream of a LATEST message, which replaces an older one of it.
struct OutgoingStream {
  std::uint64_t address = 0;  ///< dst, kind, lane, and whether there is a key
  std::uint64_t key = 0;
  friend bool operator==(const OutgoingStream&, const OutgoingStream&) = default;
};
[[nodiscard]] OutgoingStream latest_stream_of(const proto::FrameHeader& header,
                                              std::optional<std::uint64_t> key);

/// Frames on their way out: four lanes of frames that wait, the frames of one write under way, and,
/// where resume is on, the frames that were written and not confirmed. A write is gather(), the
/// system call on what it gave out, commit(). Between the two frames may be appended and confirmed;
/// nothing else may be called. Errors: std::bad_alloc of any call but drop_all(), which is the only
/// one that may follow. Thread safety:
/// guarded by its owner. Limits: the owner asks has_room() before it appends, but for what it
/// brings again after a reconnect.
class SendQueue {
 public:
  using Runs = std::deque<FrameRun>;  ///< Limit: has_room(), and what LastMessages keeps
  struct Limits {
    std::size_t queue_bytes = 256 * 1024;
    std::size_t retained_bytes = 512 * 1024;
  };
  static constexpr std::size_t kGatherBytesMax = 256 * 1024;
  static constexpr std::size_t kGatherPiecesMax = 64;

  explicit SendQueue(const Limits& limits) : limits_(limits), retained_(limits.retained_bytes) {}

  /// Keep frames until they are confirmed.
  void set_resume(bool on);
  [[nodiscard]] bool resume() const { return resume_; }

  /// Whether a frame of that size may wait. Lets unconfirmed frames go to make room, where that is
  /// allowed. A frame of any size has room in an empty queue.
  [[nodiscard]] bool has_room(std::size_t frame_size);
  /// An older frame of the stream waits and would be replaced: that needs no room.
  [[nodiscard]] bool would_replace(const OutgoingStream& stream) const {
    return latest_.contains(stream);
  }

  /// Memory for one data frame at the end of the lane; the caller writes the whole frame before it
  /// lets go of its lock. REQUIRES: 16 <= size, lane < 4.
  [[nodiscard]] std::span<std::byte> append(std::uint8_t lane, std::size_t size);
  /// The same for LATEST: in the place of the older frame of the stream, or at the end of the lane.
  [[nodiscard]] std::span<std::byte> append_latest(std::uint8_t lane, std::size_t size,
                                                   const OutgoingStream& stream);
  /// Memory for a frame that goes before all lanes and is neither counted nor kept.
  [[nodiscard]] std::span<std::byte> append_control(std::size_t size);

  /// Chooses what to write next, at most kGatherBytesMax, lower lanes first, but at least 1/16 for
  /// each lane that waits. Returns the pieces in order; empty: nothing waits. Valid until:
  /// commit().
  [[nodiscard]] std::span<const iovec> gather();
  /// `bytes` of the gathered pieces were written.
  void commit(std::size_t bytes);

  /// Bytes that wait to be written.
  [[nodiscard]] std::size_t unsent_bytes() const { return unsent_bytes_; }
  [[nodiscard]] std::size_t retained_bytes() const { return retained_.bytes(); }
  [[nodiscard]] bool all_written() const { return unsent_bytes_ == 0; }
  [[nodiscard]] std::uint64_t frames_written() const { return frames_written_; }
  [[nodiscard]] std::uint64_t frames_resent() const { return frames_resent_; }
  [[nodiscard]] std::uint64_t frames_let_go() const { return retained_.let_go(); }
  [[nodiscard]] std::uint64_t frames_replaced() const { return frames_replaced_; }

  /// CONFIRM. False: more than were ever written, so the peer is wrong.
  [[nodiscard]] bool confirm(std::uint64_t count);

  /// The connection broke: a frame partly written will be written again from its start, control
  /// frames go.
  void disconnect();
  /// The peer took `peer_taken` frames of this epoch: what came after goes out again, first.
  /// Returns how many frames were let go and are to be announced by SKIP; nothing: the count is
  /// impossible.
  [[nodiscard]] std::optional<std::uint64_t> resume_from(std::uint64_t peer_taken);
  /// A new epoch under this node id: counts begin at 0, unconfirmed frames go, those that wait stay
  /// where they are until go_on().
  void restart(std::uint32_t src);
  /// The services are declared again: what waits goes where each of them is now, by its former
  /// group, 0: nowhere. GROUP frames for others go nowhere, too. Returns how many those are. May
  /// throw std::bad_alloc.
  using GroupMap = std::unordered_map<std::uint32_t, std::uint32_t>;
  [[nodiscard]] std::uint64_t go_on(const GroupMap& moves);
  /// Since restart() and until go_on() nothing of the lanes goes.
  [[nodiscard]] bool held_back() const { return held_back_; }
  /// Everything that waits and everything unconfirmed goes. Returns frames that waited.
  std::uint64_t drop_all() noexcept;

 private:
  struct StreamHash {
    std::size_t operator()(const OutgoingStream& stream) const noexcept {
      return static_cast<std::size_t>((stream.address ^ (stream.key * 0x9E3779B97F4A7C15ull)) *
                                      0xC2B2AE3D27D4EB4Full);
    }
  };
  struct Place {
    std::shared_ptr<Chunk> chunk;
    std::size_t begin = 0;
  };
  [[nodiscard]] Place allocate(std::size_t size);
  [[nodiscard]] std::optional<std::uint8_t> pick_lane() const;
  void stage(Runs& from, std::size_t bytes_max);
  void stage_lanes();
  void stage_first(Runs& from);
  void finish(FrameRun run);
  void return_staged();

  const Limits limits_;
  bool resume_ = false;
  bool held_back_ = false;  ///< the lanes wait for go_on()

  ChunkPool pool_;
  std::shared_ptr<Chunk> open_chunk_;
  Runs control_;
  Runs resend_;  ///< written on an earlier connection, or cut by a break: in the order of their
                 ///< counts
  std::array<Runs, proto::kLaneCount> lanes_;
  std::array<std::size_t, proto::kLaneCount>
      passed_over_{};  ///< bytes that went while the lane waited
  std::unordered_map<OutgoingStream, FrameRun*, StreamHash> latest_;

  Runs staged_;                    ///< gathered; outside a write at most the rest of one frame
  std::size_t staged_bytes_ = 0;   ///< without what was written of the first
  std::size_t first_written_ = 0;  ///< bytes of the first staged frame that were written
  std::array<iovec, kGatherPiecesMax> pieces_;

  std::size_t unsent_bytes_ = 0;
  RetainedFrames retained_;
  std::uint64_t frames_written_ = 0;
  std::uint64_t frames_resent_ = 0;
  std::uint64_t frames_replaced_ = 0;
};

}  // namespace gimnet::nif
