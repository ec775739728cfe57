#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "base/mutex.hpp"
#include "client/gimi/ending.hpp"

namespace gimnet::gimi {

/// Lets one thread in after another, as a mutex does, but no thread has to wait longer than it
/// wants. Thread safety: any thread.
class GIMNET_CAPABILITY("mutex") Turns {
 private:
  friend class Turn;
  Mutex mutex_;
  Condition free_;
  bool taken_ GIMNET_GUARDED_BY(mutex_) = false;
};

/// The turn of a thread that asks the hub, until this is destroyed.
class GIMNET_SCOPED_CAPABILITY Turn {
 public:
  /// Waits for the turn for that time at most. Ask whether it came: clang's analysis takes it as
  /// come.
  Turn(Turns& turns, Timeout timeout) GIMNET_ACQUIRE(turns)
      : turns_(turns), deadline_ns_(deadline_after(timeout)), came_(take(turns, deadline_ns_)) {}
  /// For the end of a handle, which cannot fail: waits until the turn comes. The hub's answer has
  /// what is left of kLeaveTimeoutMs then, maybe nothing.
  struct Leaving {};
  Turn(Turns& turns, Leaving /*unused*/) GIMNET_ACQUIRE(turns)
      : turns_(turns),
        deadline_ns_(deadline_after(Timeout{kLeaveTimeoutMs})),
        came_(take(turns, INT64_MAX)) {}
  ~Turn() GIMNET_RELEASE() {
    if (came_) give_back(turns_);
  }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;

  [[nodiscard]] explicit operator bool() const { return came_; }
  /// The answer of a call whose turn did not come; `doing` as in "subscribe robot/odom".
  [[nodiscard]] static Failure failure(std::string_view doing) {
    return {Status::timeout, "cannot " + std::string(doing) +
                                 ": other calls of this node asked the hub for all of the time "
                                 "given"};
  }
  /// The time left for the hub's answer, as NIF takes it.
  [[nodiscard]] std::int32_t left_ms() const { return nif_timeout_until(deadline_ns_); }

 private:
  static bool take(Turns& turns, std::int64_t deadline_ns) {
    const MutexLock lock(turns.mutex_);
    while (turns.taken_) {
      if (is_over(deadline_ns)) return false;
      static_cast<void>(turns.free_.wait_until(turns.mutex_, deadline_ns));
    }
    turns.taken_ = true;
    return true;
  }
  static void give_back(Turns& turns) {
    const MutexLock lock(turns.mutex_);
    turns.taken_ = false;
    turns.free_.notify_one();
  }

  Turns& turns_;
  const std::int64_t deadline_ns_;
  const bool came_;
};

}  // namespace gimnet::gimi
