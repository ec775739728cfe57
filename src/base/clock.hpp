#pragma once

#include <chrono>
#include <cstdint>

namespace gimnet {

/// Nanoseconds of the monotonic clock: for intervals and deadlines; the start is arbitrary. Thread
/// safety: any thread.
[[nodiscard]] inline std::int64_t steady_now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

/// Nanoseconds since 1970, as times on the wire are given; may jump when the clock is set. Thread
/// safety: any thread.
[[nodiscard]] inline std::int64_t wall_now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

}  // namespace gimnet
