#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>

namespace gimnet::hub {

/// So much at once and so much a second, as docs/protocol.md promises it under "Rates": what
/// reference models count with. It shares no code with the bucket that the hub has
/// (base/token_bucket.hpp). Thread safety: none.
class Allowance {
 public:
  /// Spends one. False: nothing is left. Rate and burst may be others than before: what was left
  /// stays, up to the burst.
  [[nodiscard]] bool spend(std::uint64_t per_s, std::uint64_t burst,
                           std::chrono::milliseconds now) {
    constexpr std::uint64_t kOne = 1'000;
    if (!used_) left_ = burst * kOne;
    if (used_ && now > last_) left_ += static_cast<std::uint64_t>((now - last_).count()) * per_s;
    used_ = true;
    last_ = now;
    left_ = std::min(left_, burst * kOne);
    if (left_ < kOne) return false;
    left_ -= kOne;
    return true;
  }

 private:
  bool used_ = false;
  std::uint64_t left_ = 0;  ///< thousandths
  std::chrono::milliseconds last_{};
};

}  // namespace gimnet::hub
