#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace gimnet::tool {

/// Round trips in ns, and what is said of them in microseconds. Thread safety: one thread.
class RoundTrips {
 public:
  void add(std::int64_t ns) { ns_.push_back(ns); }
  [[nodiscard]] std::size_t count() const { return ns_.size(); }

  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  struct Summary {
    double min = kNone;
    double mean = kNone;
    double p50 = kNone;
    double p99 = kNone;
    double p99_9 = kNone;
    double max = kNone;
  };
  /// kNone, which JSON writes as null, if there are none. A percentile is the smallest value that
  /// at least that part of all does not exceed.
  [[nodiscard]] Summary summary_us() const;

 private:
  std::vector<std::int64_t> ns_;
};

}  // namespace gimnet::tool
