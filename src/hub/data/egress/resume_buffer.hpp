#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>

#include "hub/data/egress/counted_groups.hpp"
#include "hub/data/egress/entry.hpp"
#include "hub/data/egress/run.hpp"
#include "hub/data/ring_queue.hpp"

namespace gimnet::hub {

/// Data frames that were written and not confirmed yet, in the order written, so that a connection
/// can go on where it broke (docs/protocol.md, section 3). Bounded: a full buffer lets frames at
/// its front go that were not sent with BLOCK; a frame sent with BLOCK, or of a group that is
/// counted, is waited for. Thread safety: one shard.
class ResumeBuffer {
 public:
  explicit ResumeBuffer(std::uint64_t bytes_max) : bytes_max_(bytes_max) {}

  /// Room for `size` more bytes behind `planned` ones that are about to be written? Lets frames go
  /// where that helps. `counted` may be nullptr. bytes_most: a lower limit than the buffer's own.
  [[nodiscard]] bool make_room(std::uint64_t planned, std::uint32_t size,
                               const CountedGroups* counted = nullptr,
                               std::uint64_t bytes_most = UINT64_MAX);
  /// Lets frames at the front go until they come to `bytes`, or one has to be waited for. `counted`
  /// as above.
  void let_go(std::uint64_t bytes, const CountedGroups* counted);
  /// `run` was handed to the kernel.
  void wrote(Run run);
  /// The peer has taken `count` frames of this epoch. Returns how many of them are newly confirmed;
  /// none for a count that cannot be (more than was written, or less than it said before).
  std::uint64_t confirm(std::uint64_t count);

  struct Rewind {
    std::uint64_t confirmed = 0;  ///< frames newly confirmed
    std::uint64_t lost = 0;       ///< frames of the gap that no earlier rewind() called lost
    std::uint64_t gap = 0;        ///< frames let go that the peer did not take: announced with SKIP
    bool possible = false;        ///< false: the peer's count cannot be; nothing was done
  };
  /// After a break the peer says it took `count`: what it did not take moves to `replay`, to be
  /// written again first.
  [[nodiscard]] Rewind rewind(std::uint64_t count, RunQueue& replay);

  /// Gives back memory that only a busy connection needs.
  void trim() { kept_.trim(); }
  /// Forgets all, none of which was confirmed: calls lose(const Run&) for what is kept, and returns
  /// how many frames before it were let go. Counts begin at 0.
  template <class Lose>
  [[nodiscard]] std::uint64_t clear(Lose&& lose) {
    const std::uint64_t let_go = unconfirmed() - std::min(kept_frames_, unconfirmed());
    for (; !kept_.empty(); kept_.pop_front()) lose(std::as_const(kept_.front()));
    kept_frames_ = bytes_ = written_ = confirmed_ = lost_below_ = 0;
    return let_go;
  }

  [[nodiscard]] std::uint64_t written() const { return written_; }
  [[nodiscard]] std::uint64_t unconfirmed() const {
    return written_ - std::max(confirmed_, lost_below_);
  }
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }

 private:
  [[nodiscard]] std::uint64_t first_kept() const { return written_ - kept_frames_; }
  /// Is there a front frame, and may it be let go?
  [[nodiscard]] bool front_may_go(const CountedGroups* counted);
  void let_front_frame_go();
  void release_below(std::uint64_t count);

  const std::uint64_t bytes_max_;
  RingQueue<Run> kept_;
  std::uint64_t kept_frames_ = 0;
  std::uint64_t bytes_ = 0;
  std::uint64_t written_ = 0;
  std::uint64_t confirmed_ = 0;  ///< as the peer told last
  std::uint64_t lost_below_ =
      0;  ///< frames below it were confirmed or are lost, and counted as that
};

}  // namespace gimnet::hub
