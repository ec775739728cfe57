#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace gimnet::tool {

/// Round trips in ns, and what is said of them in microseconds. Thread safety: one thread.
class RoundTrips {
 public:
  void add(std::int64_t ns) { ns_.push_back(ns); }
  [[nodiscard]] std::size_t count() const { return ns_.size(); }

  struct Summary {
    double min = 0.0;
    double mean = 0.0;
    double p50 = 0.0;
    double p99 = 0.0;
    double p99_9 = 0.0;
    double max = 0.0;
  };
  /// Zeros if there are none. A percentile is the smallest value that at least that part of all does not exceed.
  [[nodiscard]] Summary summary_us() const;

 private:
  std::vector<std::int64_t> ns_;
};

}  // namespace gimnet::tool
