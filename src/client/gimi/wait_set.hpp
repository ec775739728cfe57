#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>

#include "base/mutex.hpp"
#include "gimnet/gimi/outcome.hpp"
#include "gimnet/gimi_wait.h"
#include "net/wait.hpp"

namespace gimnet::gimi {

class WaitSet;

/// A place in a ring of places; alone in its own by itself.
class WaitLink {
 public:
  WaitLink() = default;
  WaitLink(const WaitLink&) = delete;
  WaitLink& operator=(const WaitLink&) = delete;

  [[nodiscard]] bool alone() const { return next_ == this; }
  [[nodiscard]] WaitLink* next() const { return next_; }
  [[nodiscard]] WaitLink* previous() const { return previous_; }
  void leave() {
    previous_->next_ = next_;
    next_->previous_ = previous_;
    next_ = previous_ = this;
  }
  /// REQUIRES: alone().
  void enter_before(WaitLink& other) {
    next_ = &other;
    previous_ = other.previous_;
    previous_->next_ = this;
    other.previous_ = this;
  }

 private:
  WaitLink* next_ = this;
  WaitLink* previous_ = this;
};

/// Tells a WaitSet of a queue whether a call that receives would answer at once. It is in one set
/// or in none. Thread safety: guarded by the mutex of its queue, which comes before the set's.
/// Lifetime: the set outlives it.
class WaitSource : private WaitLink {
 public:
  WaitSource() = default;
  ~WaitSource() { leave(); }

  /// The queue has become empty, or is so no longer. Without a set it costs nothing.
  void update(bool ready) {
    if (set_ != nullptr && ready != ready_) change(ready);
  }
  /// `owner`: the object of the handle by which it is a member.
  struct Member {
    const void* owner = nullptr;
    gimi_handle handle = 0;
    std::uint64_t user = 0;
  };
  /// False: it is in a set.
  [[nodiscard]] bool join(std::shared_ptr<WaitSet> set, const Member& member, bool ready);
  [[nodiscard]] bool is_member() const { return set_ != nullptr; }
  [[nodiscard]] bool is_member(const WaitSet* set, const void* owner) const {
    return set_ != nullptr && set_.get() == set && member_.owner == owner;
  }
  /// As far as that handle brought it in.
  void leave(const void* owner) {
    if (member_.owner == owner) leave();
  }
  void leave();

 private:
  friend class WaitSet;
  void change(bool ready);

  std::shared_ptr<WaitSet> set_;
  Member member_;
  bool ready_ = false;
};

/// Called with the mutex of the source's queue held. `ready`: is it so now?
using SourceVisitor = std::function<void(WaitSource& source, bool ready)>;

/// Members that may have something to receive, in a list of those that do. Level-triggered: one
/// stays in the list until it has nothing more, so the cost of a call depends on what is ready and
/// not on the number of members. Thread safety: any thread. Limit: kHandlesMax members.
class WaitSet {
 public:
  /// Waits until a member is ready, or for wake(). Their number, at most as many as `ready` has
  /// places, beginning with those that were given longest ago. Errors: timeout, closed.
  [[nodiscard]] Outcome<std::size_t> wait(std::span<gimi_ready> ready, Timeout timeout)
      GIMNET_EXCLUDES(mutex_);
  /// One wait() ends, now or the next one.
  void wake() GIMNET_EXCLUDES(mutex_);
  /// Readable while wait() would not wait. It is the set's. Errors: system.
  [[nodiscard]] Outcome<int> descriptor() GIMNET_EXCLUDES(mutex_);
  /// Nobody is a member any more; calls that wait answer closed.
  void end() GIMNET_EXCLUDES(mutex_);

 private:
  friend class WaitSource;
  [[nodiscard]] bool has_ended() GIMNET_EXCLUDES(mutex_);
  void put(WaitSource& source) GIMNET_EXCLUDES(mutex_);
  void take_out(WaitSource& source) GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] bool is_awake() const GIMNET_REQUIRES(mutex_) { return woken_ || !ready_.alone(); }
  /// Has the descriptor show what is so: a system call if that has changed.
  void show() GIMNET_REQUIRES(mutex_);

  Mutex mutex_;
  Condition changed_;
  WaitLink ready_ GIMNET_GUARDED_BY(mutex_);  ///< sources; each has something to receive
  std::size_t waiting_ GIMNET_GUARDED_BY(mutex_) = 0;
  bool woken_ GIMNET_GUARDED_BY(mutex_) = false;
  bool ended_ GIMNET_GUARDED_BY(mutex_) = false;
  bool shown_ GIMNET_GUARDED_BY(mutex_) = false;
  std::optional<net::WakeSignal> signal_ GIMNET_GUARDED_BY(mutex_);  ///< once asked for
};

/// This thread runs a callback, which must not wait for a reply: gimi_in_callback().
[[nodiscard]] bool is_in_callback();
/// Answers what it was.
bool set_in_callback(bool inside);

}  // namespace gimnet::gimi
