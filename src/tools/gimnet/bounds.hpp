#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "base/clock.hpp"
#include "gimnet/gimi/outcome.hpp"
#include "tools/gimnet/options.hpp"

namespace gimnet::tool {

/// When a command that could go on for ever ends: -n and --seconds. Times are those of
/// steady_now_ns(). Thread safety: one thread.
class Bounds {
 public:
  explicit Bounds(const ToolOptions& options, std::int64_t now_ns = steady_now_ns())
      : count_(options.count),
        end_ns_(options.seconds > 0.0 ? now_ns + std::llround(options.seconds * 1e9) : 0) {}

  /// As many as wanted have come.
  [[nodiscard]] bool enough(std::uint64_t came) const { return count_ != 0 && came >= count_; }
  [[nodiscard]] bool late(std::int64_t now_ns = steady_now_ns()) const {
    return end_ns_ != 0 && now_ns >= end_ns_;
  }
  /// `longest`, or what is left until the end if that is less; rounded up, so that it is over then.
  [[nodiscard]] Timeout wait(Timeout longest, std::int64_t now_ns = steady_now_ns()) const {
    if (end_ns_ == 0) return longest;
    constexpr std::int64_t kNsInMs = 1'000'000;
    const std::int64_t left_ms =
        std::max<std::int64_t>(0, (end_ns_ - now_ns + kNsInMs - 1) / kNsInMs);
    return std::min(longest, Timeout{left_ms});
  }
  /// Time was up before there was what was asked for: `count` messages, or any.
  [[nodiscard]] bool missed(std::uint64_t came) const {
    return came < std::max<std::uint64_t>(count_, 1);
  }

 private:
  std::uint64_t count_;
  std::int64_t end_ns_;
};

}  // namespace gimnet::tool
