#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

namespace gimnet::sim {

/// Simulated time since the world began.
using Time = std::chrono::microseconds;

/// Events to come, ordered by time. Events of one time keep the order in which they were added.
/// Thread safety: none.
class Agenda {
 public:
  using Action = std::function<void()>;

  [[nodiscard]] Time now() const { return now_; }
  /// As the conductor's clock shows it.
  [[nodiscard]] std::chrono::milliseconds now_ms() const {
    return std::chrono::duration_cast<std::chrono::milliseconds>(now_);
  }
  void at(Time time, Action action) {
    entries_.push_back({std::max(time, now_), ++last_, std::move(action)});
    std::push_heap(entries_.begin(), entries_.end(), later);
  }
  void after(Time delay, Action action) { at(now_ + delay, std::move(action)); }

  /// Lets the next thing happen. False: nothing is to happen, or not before `end`.
  bool step(Time end) {
    if (entries_.empty() || entries_.front().time > end) return false;
    std::pop_heap(entries_.begin(), entries_.end(), later);
    Entry entry = std::move(entries_.back());
    entries_.pop_back();
    now_ = entry.time;
    entry.action();
    return true;
  }

 private:
  struct Entry {
    Time time;
    std::uint64_t number;
    Action action;
  };
  static bool later(const Entry& a, const Entry& b) {
    return a.time != b.time ? a.time > b.time : a.number > b.number;
  }

  std::vector<Entry> entries_;  ///< a heap
  std::uint64_t last_ = 0;
  Time now_{0};
};

}  // namespace gimnet::sim
