#pragma once

#include <atomic>
#include <cstdint>

namespace gimnet::hub {

/// Wakes one thread that waits for a descriptor, and only if it sleeps: a running thread costs its
/// senders one load.
///
/// The sleeper says prepare_to_sleep(), looks at its queues once more, and only then waits for
/// descriptor(); after it woke it says awake(). A sender publishes its item, then says wake().
/// Thread safety: wake() from any thread; the rest from the sleeper's.
class Waker {
 public:
  Waker();
  ~Waker();
  Waker(const Waker&) = delete;
  Waker& operator=(const Waker&) = delete;

  /// Sender: returns whether a system call was made.
  bool wake();

  /// Sleeper: from here on a wake() makes descriptor() readable.
  void prepare_to_sleep();
  /// Sleeper: a wake() costs its sender nothing again.
  void awake();
  /// Sleeper: after descriptor() was readable.
  void clear();
  [[nodiscard]] int descriptor() const { return descriptor_; }

 private:
  int descriptor_;
  alignas(64) std::atomic<bool> sleeping_{false};
};

}  // namespace gimnet::hub
