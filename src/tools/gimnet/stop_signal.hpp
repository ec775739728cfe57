#pragma once

#include <cstdint>
#include <functional>
#include <thread>

#include "base/mutex.hpp"

namespace gimnet::tool {

/// Ctrl-C, SIGTERM and the end of the terminal (SIGHUP, unless it was ignored before, as nohup
/// does), turned into a request to stop: waits end, and the program can leave the hub in good
/// order, for which it has kPatienceNs. A second Ctrl-C or SIGTERM ends it at once. One for a
/// program, made before any other thread. Thread safety: any thread.
class StopSignal {
 public:
  /// A hub that works takes a goodbye within some milliseconds. The user waits 200 ms at most, also
  /// on a busy machine.
  static constexpr std::int64_t kPatienceNs = 100'000'000;

  StopSignal();
  ~StopSignal();
  StopSignal(const StopSignal&) = delete;
  StopSignal& operator=(const StopSignal&) = delete;

  /// The signal, or 0.
  [[nodiscard]] int signal() GIMNET_EXCLUDES(mutex_);
  /// Readable once there was one.
  [[nodiscard]] int descriptor() const { return descriptor_; }
  /// Waits until steady_now_ns() reaches `deadline_ns`. False: a signal came before.
  [[nodiscard]] bool wait_until(std::int64_t deadline_ns) GIMNET_EXCLUDES(mutex_);
  /// Until on_stop() is called, a signal ends the program at once: it has nothing to leave.
  void end_at_once() GIMNET_EXCLUDES(mutex_);
  /// Called once, on another thread, when a signal comes; an empty one takes the last away.
  void on_stop(std::function<void()> action) GIMNET_EXCLUDES(mutex_, action_mutex_);
  /// After a signal, returns when the action is over. Ends the program with that code if that is
  /// later than kPatienceNs after the signal.
  void leave(int code) GIMNET_EXCLUDES(mutex_);

 private:
  void watch();
  void take(int signal) GIMNET_EXCLUDES(mutex_);

  int descriptor_ = -1;
  std::thread watcher_;
  Mutex action_mutex_;  ///< held while the action runs
  std::function<void()> action_ GIMNET_GUARDED_BY(action_mutex_);
  Mutex mutex_;
  Condition changed_;
  int signal_ GIMNET_GUARDED_BY(mutex_) = 0;
  std::int64_t taken_ns_ GIMNET_GUARDED_BY(mutex_) = 0;
  bool ends_at_once_ GIMNET_GUARDED_BY(mutex_) = false;
  bool is_over_ GIMNET_GUARDED_BY(mutex_) = false;  ///< the action was called
};

}  // namespace gimnet::tool
