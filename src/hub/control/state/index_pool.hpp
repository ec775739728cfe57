#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

namespace gimnet::hub {

/// Hands out indices 1..most cyclically. An index that was given back rests before it can come again, so that frames
/// still under way to its former holder never reach a stranger.
/// Thread safety: none. Limits: `most` indices; one bit each.
class IndexPool {
 public:
  /// REQUIRES: most > 0.
  IndexPool(std::uint32_t most, std::chrono::milliseconds resting_time);

  /// The next index that is neither held nor resting; nothing if there is none.
  [[nodiscard]] std::optional<std::uint32_t> take(std::chrono::milliseconds now);
  /// REQUIRES: the index is held.
  void give_back(std::uint32_t index, std::chrono::milliseconds now);
  [[nodiscard]] std::uint32_t held() const { return held_; }

 private:
  struct Resting {
    std::chrono::milliseconds until;
    std::uint32_t index;
  };
  void wake(std::chrono::milliseconds now);

  const std::uint32_t most_;
  const std::chrono::milliseconds resting_time_;
  std::vector<bool> taken_;  ///< held or resting; grows with the highest index so far
  std::deque<Resting> resting_;
  std::uint32_t next_ = 1;
  std::uint32_t held_ = 0;
};

}  // namespace gimnet::hub
