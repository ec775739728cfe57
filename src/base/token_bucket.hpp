#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>

namespace gimnet {

/// Bounds how often something may happen: a bucket of tokens, full at first, that time fills again.
/// Time and rate are arguments, so that a rate may change between two steps. Thread safety: none.
class TokenBucket {
 public:
  struct Rate {
    std::uint64_t per_s = 1;  ///< 1 to 10^9
    std::uint64_t burst = 1;  ///< what the bucket holds, 1 to 10^9
  };

  /// Takes a token; false: there is none. A clock that goes back fills nothing.
  [[nodiscard]] bool take(const Rate& rate, std::chrono::milliseconds now) {
    const std::uint64_t full = rate.burst * kToken;
    if (last_ == kNever) {
      left_ = full;
    } else if (now > last_) {
      const auto passed_ms = static_cast<std::uint64_t>((now - last_).count());
      // A token a second is a thousandth of one a millisecond.
      left_ = passed_ms > full / rate.per_s ? full : left_ + passed_ms * rate.per_s;
    }
    last_ = now;
    left_ = std::min(left_, full);
    if (left_ < kToken) return false;
    left_ -= kToken;
    return true;
  }

 private:
  static constexpr std::uint64_t kToken = 1'000;
  static constexpr std::chrono::milliseconds kNever = std::chrono::milliseconds::min();

  std::chrono::milliseconds last_ = kNever;
  std::uint64_t left_ = 0;  ///< thousandths of a token
};

}  // namespace gimnet
