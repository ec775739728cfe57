#pragma once

#include <cstdint>

namespace gimnet::tool {

/// When to say on standard error what goes on happening. Times are those of steady_now_ns(). Thread
/// safety: one thread.
class NewsPace {
 public:
  /// How often it is said at most.
  static constexpr std::int64_t kPeriodNs = 1'000'000'000;

  /// There is something to say: now? If so, not again for kPeriodNs.
  [[nodiscard]] bool due(std::int64_t now_ns) {
    if (now_ns < next_ns_) return false;
    next_ns_ = now_ns + kPeriodNs;
    return true;
  }

 private:
  std::int64_t next_ns_ = 0;
};

}  // namespace gimnet::tool
