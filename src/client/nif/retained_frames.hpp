#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>

#include "client/nif/frame_run.hpp"

namespace gimnet::nif {

/// Frames that were written and not confirmed, by their count in this epoch (docs/protocol.md,
/// section 3, Resume). Thread safety: guarded by its owner.
class RetainedFrames {
 public:
  explicit RetainedFrames(std::size_t bytes_max) : bytes_max_(bytes_max) {}

  /// Frames that were written just now; `keep` false only counts them.
  void written(FrameRun run, bool keep);
  /// `upcoming`: frames handed to the kernel by a write whose written() comes later; a confirmation
  /// may overtake it.
  [[nodiscard]] bool confirm(std::uint64_t count, std::uint64_t upcoming);

  /// Whether `more` bytes may be kept in addition; lets frames at the front go that were not sent
  /// with BLOCK.
  [[nodiscard]] bool make_room(std::size_t more);

  /// The peer took `peer_taken` frames: takes out what came after, to be sent again, and sets the
  /// count back to the first of these. Returns how many frames before it are missing; nothing: more
  /// than were written.
  [[nodiscard]] std::optional<std::uint64_t> take_after(std::uint64_t peer_taken,
                                                        std::deque<FrameRun>& again);
  /// Counts begin at 0.
  void restart();

  [[nodiscard]] std::size_t bytes() const { return bytes_; }
  [[nodiscard]] std::uint64_t next_count() const { return next_; }
  [[nodiscard]] std::uint64_t let_go() const { return let_go_; }

 private:
  [[nodiscard]] std::uint64_t first() const { return next_ - frames_; }
  void drop_front(std::uint64_t count);

  const std::size_t bytes_max_;
  std::deque<FrameRun> runs_;  ///< Limit: bytes_max_
  std::size_t bytes_ = 0;
  std::uint64_t frames_ = 0;  ///< in runs_
  std::uint64_t next_ = 0;    ///< count of the next frame that is written
  std::uint64_t confirmed_ = 0;
  std::uint64_t let_go_ = 0;
};

}  // namespace gimnet::nif
