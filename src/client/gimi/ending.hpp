#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include "base/clock.hpp"
#include "gimnet/gimi/outcome.hpp"

namespace gimnet::gimi {

/// Why a node gives and takes nothing more: the program closed it, or no connection to the hub will
/// come any more. A value type; by itself: it goes on.
class Ending {
 public:
  Ending() = default;
  /// `why` as in "the node was closed". REQUIRES: not empty.
  Ending(Status status, std::string why) : status_(status), why_(std::move(why)) {}
  [[nodiscard]] static Ending closed() { return {Status::closed, "the node was closed"}; }

  [[nodiscard]] explicit operator bool() const { return !why_.empty(); }
  [[nodiscard]] const std::string& why() const { return why_; }
  /// The answer of a call; `doing` as in "send to 7.17".
  [[nodiscard]] Failure failure(std::string_view doing) const {
    return {status_, "cannot " + std::string(doing) + ": " + why_};
  }

 private:
  Status status_ = Status::closed;
  std::string why_;
};

/// The end of a handle of the program waits for so long for the hub's answer.
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

/// The time left until a deadline, rounded up, as NIF takes it.
[[nodiscard]] inline std::int32_t nif_timeout_until(std::int64_t deadline_ns) {
  if (deadline_ns == INT64_MAX) return -1;
  const std::int64_t left_ns = std::max<std::int64_t>(deadline_ns - steady_now_ns(), 0);
  return nif_timeout(Timeout{(left_ns + 999'999) / 1'000'000});
}

}  // namespace gimnet::gimi
