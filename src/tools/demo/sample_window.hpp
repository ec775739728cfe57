#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace gimnet::demo {

/// The latest durations, for percentiles and a little curve. Thread safety: one thread. Limits:
/// keeps `capacity`.
class SampleWindow {
 public:
  /// REQUIRES: capacity > 0.
  explicit SampleWindow(std::size_t capacity) : capacity_(capacity) {}

  void add(std::int64_t duration_ns);

  /// The smallest duration that `percent` of all are not above (nearest rank); nothing if there are
  /// none.
  [[nodiscard]] std::optional<std::int64_t> percentile_ns(double percent) const;

  /// The latest `count` durations, oldest first; fewer if there are fewer.
  [[nodiscard]] std::vector<std::int64_t> latest(std::size_t count) const;

 private:
  std::size_t capacity_;
  std::vector<std::int64_t> samples_;
  std::size_t oldest_ = 0;
};

/// Counts events within the last seconds. Thread safety: one thread.
class RateMeter {
 public:
  static constexpr std::int64_t kWindow_ns = 3'000'000'000;

  void add(std::int64_t now_ns);
  /// Events per second.
  [[nodiscard]] double rate_hz(std::int64_t now_ns) const;

 private:
  std::vector<std::int64_t> times_ns_;
  std::optional<std::int64_t> first_ns_;
};

}  // namespace gimnet::demo
