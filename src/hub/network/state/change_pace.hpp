#pragma once

#include <algorithm>
#include <chrono>

namespace gimnet::hub {

/// Bounds how often something is done: the first time at once, then with pauses that double while
/// changes go on. A quiet time of two pauses begins anew. Thread safety: none. Time is an argument.
class ChangePace {
 public:
  struct Pauses {
    std::chrono::milliseconds first;
    std::chrono::milliseconds most;
  };
  explicit ChangePace(Pauses pauses) : pauses_(pauses), pause_(pauses.first) {}

  /// From when on it may be done.
  [[nodiscard]] std::chrono::milliseconds next() const { return next_; }
  /// It is done. REQUIRES: now >= next().
  void note_done(std::chrono::milliseconds now) {
    const bool quiet = now >= next_ + pause_;
    pause_ = quiet ? pauses_.first : std::min(2 * pause_, pauses_.most);
    next_ = now + pause_;
  }

 private:
  const Pauses pauses_;
  std::chrono::milliseconds pause_;
  std::chrono::milliseconds next_ = std::chrono::milliseconds::min() / 2;
};

}  // namespace gimnet::hub
