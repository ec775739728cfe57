#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>

#include "base/clock.hpp"
#include "gimnet/gimi/outcome.hpp"

namespace gimnet::gimi {

/// How long the end of a handle of the program waits for the hub's answer.
inline constexpr std::int32_t kLeaveTimeoutMs = 1000;

/// When a wait ends, as steady_now_ns(); INT64_MAX: never.
[[nodiscard]] inline std::int64_t deadline_after(Timeout timeout) {
  // Waits of a year and more have no end, so that no sum overflows.
  if (timeout < Timeout{0} || timeout > std::chrono::hours{24 * 365}) return INT64_MAX;
  return steady_now_ns() + std::chrono::nanoseconds(timeout).count();
}

[[nodiscard]] inline bool is_over(std::int64_t deadline_ns) {
  return deadline_ns != INT64_MAX && steady_now_ns() >= deadline_ns;
}

/// A timeout as NIF takes it.
[[nodiscard]] inline std::int32_t nif_timeout(Timeout timeout) {
  if (timeout < Timeout{0}) return -1;
  return static_cast<std::int32_t>(std::min<std::int64_t>(timeout.count(), INT32_MAX));
}

/// What is left until a deadline, rounded up, as NIF takes it.
[[nodiscard]] inline std::int32_t nif_timeout_until(std::int64_t deadline_ns) {
  if (deadline_ns == INT64_MAX) return -1;
  const std::int64_t left_ns = std::max<std::int64_t>(deadline_ns - steady_now_ns(), 0);
  return nif_timeout(Timeout{(left_ns + 999'999) / 1'000'000});
}

}  // namespace gimnet::gimi
