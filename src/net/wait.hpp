#pragma once

#include <cstdint>
#include <functional>
#include <utility>

#include "base/clock.hpp"
#include "net/stream.hpp"

// Waiting for a stream, or for another thread.

namespace gimnet::net {

/// A time of steady_now_ns(); INT64_MAX: never.
using Deadline = std::int64_t;
inline constexpr Deadline kNever = INT64_MAX;
inline constexpr std::int64_t kNsPerMs = 1'000'000;

/// Wakes a thread that waits in wait_for(). Thread safety: any thread.
class WakeSignal {
 public:
  WakeSignal();  ///< valid() tells whether the system had a descriptor left
  ~WakeSignal();
  WakeSignal(const WakeSignal&) = delete;
  WakeSignal& operator=(const WakeSignal&) = delete;
  [[nodiscard]] bool valid() const { return descriptor_ >= 0; }
  [[nodiscard]] int descriptor() const { return descriptor_; }
  void raise();
  void clear();

  /// A thread that waits for the signal calls this now and then, kBeatNs apart at most: it has
  /// other work that can't wait until a dial has ended. REQUIRES: one thread waits, and sets it.
  void set_beat(std::function<void()> beat) { beat_ = std::move(beat); }
  static constexpr std::int64_t kBeatNs = 50 * kNsPerMs;
  /// Gives the waiting thread its beat. The deadline, or an earlier one, by which the next is due.
  [[nodiscard]] Deadline beat(Deadline deadline) const;

 private:
  const int descriptor_;
  std::function<void()> beat_;
};

struct Readiness {
  bool readable = false;  ///< or ended, or failed: receive() tells
  bool writable = false;
  bool woken = false;
};

/// Waits until the stream is ready for what is asked, the signal is raised, or the deadline. Bytes
/// that the stream keeps are there without a wait. Null: only the signal counts. If the signal has
/// a beat, the wait may end before the deadline.
[[nodiscard]] Readiness wait_for(const Stream* stream, Interest interest, const WakeSignal& wake,
                                 Deadline deadline);

struct Raised {
  bool one = false;
  bool other = false;
};
/// Waits until one of them is raised, or the deadline; maybe less. `other` may have a beat.
[[nodiscard]] Raised wait_for_either(const WakeSignal& one, const WakeSignal& other,
                                     Deadline deadline);

}  // namespace gimnet::net
