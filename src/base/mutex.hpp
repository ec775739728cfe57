#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>

// clang's thread-safety annotations (-Wthread-safety); nothing with other compilers.

#if defined(__clang__)
#define GIMNET_THREAD_ANNOTATION(attribute) __attribute__((attribute))
#else
#define GIMNET_THREAD_ANNOTATION(attribute)
#endif

#define GIMNET_CAPABILITY(name) GIMNET_THREAD_ANNOTATION(capability(name))
#define GIMNET_SCOPED_CAPABILITY GIMNET_THREAD_ANNOTATION(scoped_lockable)
#define GIMNET_GUARDED_BY(mutex) GIMNET_THREAD_ANNOTATION(guarded_by(mutex))
#define GIMNET_REQUIRES(...) GIMNET_THREAD_ANNOTATION(requires_capability(__VA_ARGS__))
#define GIMNET_EXCLUDES(...) GIMNET_THREAD_ANNOTATION(locks_excluded(__VA_ARGS__))
#define GIMNET_ACQUIRE(...) GIMNET_THREAD_ANNOTATION(acquire_capability(__VA_ARGS__))
#define GIMNET_RELEASE(...) GIMNET_THREAD_ANNOTATION(release_capability(__VA_ARGS__))
#define GIMNET_NO_THREAD_SAFETY_ANALYSIS GIMNET_THREAD_ANNOTATION(no_thread_safety_analysis)

// A mutex, its lock and its condition, with the annotations that libstdc++ leaves out. For client
// and cold code only.

namespace gimnet {

class GIMNET_CAPABILITY("mutex") Mutex {
 public:
  Mutex() = default;
  Mutex(const Mutex&) = delete;
  Mutex& operator=(const Mutex&) = delete;
  void lock() GIMNET_ACQUIRE() { mutex_.lock(); }
  void unlock() GIMNET_RELEASE() { mutex_.unlock(); }

 private:
  friend class Condition;
  std::mutex mutex_;
};

class GIMNET_SCOPED_CAPABILITY MutexLock {
 public:
  explicit MutexLock(Mutex& mutex) GIMNET_ACQUIRE(mutex) : mutex_(mutex) { mutex_.lock(); }
  ~MutexLock() GIMNET_RELEASE() { mutex_.unlock(); }
  MutexLock(const MutexLock&) = delete;
  MutexLock& operator=(const MutexLock&) = delete;

 private:
  Mutex& mutex_;
};

/// Waits are spurious: the caller asks again what it waits for.
class Condition {
 public:
  void wait(Mutex& mutex) GIMNET_REQUIRES(mutex) {
    std::unique_lock<std::mutex> lock(mutex.mutex_, std::adopt_lock);
    condition_.wait(lock);
    lock.release();
  }
  /// Until notified, or steady_now_ns() reaches `deadline_ns`; INT64_MAX: no limit. False: the time
  /// is up.
  bool wait_until(Mutex& mutex, std::int64_t deadline_ns) GIMNET_REQUIRES(mutex) {
    if (deadline_ns == INT64_MAX) {
      wait(mutex);
      return true;
    }
    const std::chrono::steady_clock::time_point deadline{std::chrono::nanoseconds(deadline_ns)};
    std::unique_lock<std::mutex> lock(mutex.mutex_, std::adopt_lock);
    const bool notified = condition_.wait_until(lock, deadline) == std::cv_status::no_timeout;
    lock.release();
    return notified;
  }
  void notify_one() { condition_.notify_one(); }
  void notify_all() { condition_.notify_all(); }

 private:
  std::condition_variable condition_;
};

}  // namespace gimnet
