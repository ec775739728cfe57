#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <utility>

#include "gimnet/gimi/answers.hpp"
#include "gimnet/gimi/handles.hpp"
#include "gimnet/gimi/namespace.hpp"
#include "gimnet/gimi/wait_set.hpp"
#include "gimnet/gimi/watches.hpp"

// Callbacks in a thread of the program. Programs include this header beside gimnet/gimi.hpp, which
// compiles faster without it.
//
//     gimnet::Executor executor;
//     executor.on(pose, [](const gimnet::Message& message) { show(message.text()); }).or_throw();
//     executor.every(std::chrono::milliseconds{100}, [&] { odometry.publish(position()); });
//     executor.run().or_throw();

namespace gimnet::inline GIMNET_GIMI_NAMESPACE {

/// Calls the program back for what comes, in the thread that is in run(). A callback that blocks
/// keeps nobody else's data, nor those of its own nodes, which wait in their queues. One that
/// throws ends run() with its exception; run() may be called again. A callback may do all that any
/// code may, but Node::request(), which answers bad_argument: use request_later(). Thread safety:
/// one thread, but stop(), which any may call; a second thread uses a second Executor. Lifetime:
/// what `on` was told is held until off(), or its end.
class Executor {
 public:
  using Id = std::uint64_t;
  /// The answer of on(): what off() ends, or why nothing will be called.
  class [[nodiscard]] Added : public Outcome<Id> {
   public:
    Added(Outcome<Id> outcome) : Outcome<Id>(std::move(outcome)) {}
#if defined(__cpp_exceptions)
    /// The id may be ignored.
    Id or_throw() && { return static_cast<Outcome<Id>&&>(*this).or_throw(); }
#endif
  };

#if defined(__cpp_exceptions)
  /// Throws GimnetError.
  Executor() = default;
#endif
  explicit Executor(WaitSet set) : set_(std::move(set)) {}
  Executor(const Executor&) = delete;
  Executor& operator=(const Executor&) = delete;

  /// Calls `callback(Message)` for each message of a Subscription or Queue (so of an accepted
  /// service), `callback(Request)` for each of Answers, `callback(WatchEvent)` for each of a Watch,
  /// `callback(ConnectionEvent)` for each of a ConnectionWatch. Every member gets its turn: one
  /// message in each. Errors: taken (it is in a WaitSet, or has a
  /// callback), closed.
  template <class Source, class Callback>
  Added on(const Source& source, Callback callback) {
    return add(source, [source, callback = std::move(callback)]() mutable {
      auto got = source.receive(kNoWait);
      if (got) callback(std::move(*got));
      return got.ok() || !has_ended(got.failure().status);
    });
  }
  /// Calls `callback(std::size_t)` with the number of subscribers, at first and when it changes.
  template <class Callback>
  Added on(const Publisher& publisher, Callback callback) {
    return add(publisher, [publisher, callback = std::move(callback)]() mutable {
      const auto count = publisher.subscribers_changed(kNoWait);
      if (count) callback(*count);
      return count.ok() || !has_ended(count.failure().status);
    });
  }
  /// Calls `callback(Reply)` with the end of a request.
  template <class Callback>
  Added on(const PendingReply& pending, Callback callback) {
    return add(pending, [pending, callback = std::move(callback)]() mutable {
      auto reply = pending.wait(kNoWait);
      if (reply) callback(std::move(*reply));
      return !reply;
    });
  }
  /// Calls `callback()` each time when `period` has passed since it was due last, 1 ms to 100
  /// years. What is missed while others are called is left out.
  template <class Callback>
  Id every(Timeout period, Callback callback) {
    auto timer = std::make_shared<Timer>();
    timer->period = std::clamp(period, Timeout{1}, kPeriodMax);
    timer->due = Clock::now() + timer->period;
    timer->call = std::move(callback);
    timers_.emplace(++last_, std::move(timer));
    return last_;
  }
  /// Nothing is called for that any more. Does nothing if it has ended.
  void off(Id id) {
    const auto place = members_.find(id);
    if (place != members_.end()) {
      static_cast<void>(gimi_wait_set_remove(set_.c_handle(), place->second->handle));
      members_.erase(place);
    }
    timers_.erase(id);
  }

  /// Calls back until stop(), or until there is nothing to wait for: all that `on` was told has
  /// ended, as it does with its node, and there is no `every`. Errors: bad_argument (inside a
  /// callback of this Executor).
  Outcome<void> run() {
    if (running_) return Failure{Status::bad_argument, "the Executor runs already"};
    const Inside inside(running_);
    while (!stop_.exchange(false) && !(members_.empty() && timers_.empty())) {
      std::array<gimi_ready, 64> ready;
      std::size_t count = 0;
      const gimi_status status =
          gimi_wait_set_wait(set_.c_handle(), ready.data(), ready.size(), sizeof(gimi_ready),
                             milliseconds_of(until_due()), &count);
      if (status != GIMI_OK && status != GIMI_TIMEOUT) return failure_of(status);
      for (std::size_t i = 0; i < count && !stop_; ++i) call_member(ready[i].user);
      call_timers();
    }
    return {};
  }
  /// run() ends after the callback that it is in; one that has not begun ends at once.
  void stop() {
    stop_ = true;
    set_.wake();
  }

 private:
  using Clock = std::chrono::steady_clock;
  /// A later time could be more than a time_point holds.
  static constexpr Timeout kPeriodMax = std::chrono::hours(24 * 365 * 100);
  struct Member {
    gimi_handle handle = 0;
    std::function<bool()> call;  ///< false: nothing more comes
  };
  struct Timer {
    Timeout period{};
    Clock::time_point due;
    std::function<void()> call;
  };
  /// Also if a callback throws.
  class Inside {
   public:
    explicit Inside(bool& running) : running_(running), before_(gimi_in_callback(1)) {
      running_ = true;
    }
    Inside(const Inside&) = delete;
    Inside& operator=(const Inside&) = delete;
    ~Inside() {
      static_cast<void>(gimi_in_callback(before_));
      running_ = false;
    }

   private:
    bool& running_;
    const std::int32_t before_;
  };

  /// Nothing more comes: other failures pass.
  [[nodiscard]] static bool has_ended(Status status) {
    return status == Status::closed || status == Status::refused ||
           status == Status::not_connected || status == Status::forked;
  }
  template <class Source, class Call>
  Added add(const Source& source, Call call) {
    const auto added = set_.add(source, last_ + 1);
    if (!added) return Outcome<Id>(added.failure());
    auto member = std::make_shared<Member>();
    member->handle = source.c_handle();
    member->call = std::move(call);
    members_.emplace(++last_, std::move(member));
    return Outcome<Id>(last_);
  }
  void call_member(Id id) {
    const auto place = members_.find(id);
    if (place == members_.end()) return;  // a callback before it said off()
    const auto member = place->second;    // lives on if its own does
    if (!member->call()) off(id);
  }
  void call_timers() {
    const auto now = Clock::now();
    for (auto place = timers_.begin(); place != timers_.end() && !stop_;) {
      const Id id = place->first;
      const auto timer = place->second;
      if (timer->due <= now) {
        timer->due += ((now - timer->due) / timer->period + 1) * timer->period;
        timer->call();
      }
      place = timers_.upper_bound(id);
    }
  }
  [[nodiscard]] Timeout until_due() const {
    if (timers_.empty()) return kForever;
    auto due = Clock::time_point::max();
    for (const auto& [id, timer] : timers_) due = std::min(due, timer->due);
    const auto left = std::chrono::ceil<Timeout>(due - Clock::now());
    return std::max(left, kNoWait);
  }

  WaitSet set_;
  std::map<Id, std::shared_ptr<Member>> members_;
  std::map<Id, std::shared_ptr<Timer>> timers_;
  Id last_ = 0;
  bool running_ = false;
  std::atomic<bool> stop_{false};
};

}  // namespace gimnet::inline GIMNET_GIMI_NAMESPACE
