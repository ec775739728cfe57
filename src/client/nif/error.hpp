#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "base/clock.hpp"
#include "gimnet/nif.h"

// What calls answer, and the sentence that stands behind the answer.

namespace gimnet::nif {

/// A failed step: the status and, for people, what happened, to what, and what to do.
struct Failure {
  nif_status status = NIF_OK;
  std::string sentence;
  bool nobody_listens = false;  ///< at the hub's address: its process is gone
};

/// Stores the sentence for nif_error_text() of this thread and returns the status.
nif_status fail(nif_status status, std::string_view sentence);
nif_status fail(const Failure& failure);

/// The sentence that fail() stored last in this thread. Valid until: the next fail() of this
/// thread.
[[nodiscard]] const char* error_text();

/// A time of steady_now_ns(); INT64_MAX: never.
using Deadline = std::int64_t;
inline constexpr Deadline kNever = INT64_MAX;
inline constexpr std::int64_t kNsPerMs = 1'000'000;

[[nodiscard]] inline Deadline deadline_after(std::int32_t timeout_ms) {
  return timeout_ms < 0 ? kNever : steady_now_ns() + timeout_ms * kNsPerMs;
}

}  // namespace gimnet::nif
