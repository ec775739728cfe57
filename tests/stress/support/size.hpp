#pragma once

#include <chrono>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <string_view>

// The amount of work of a run, and the time that it waits before it calls a thing broken.

namespace gimnet::stress {

/// True with GIMNET_STRESS=full in the environment: the sizes of docs/requirements.md instead of a
/// tenth of them.
[[nodiscard]] inline bool is_full_size() {
  const char* size = std::getenv("GIMNET_STRESS");
  return size != nullptr && std::string_view(size) == "full";
}

using Clock = std::chrono::steady_clock;

/// A point in time after which waiting is a failure.
class Deadline {
 public:
  explicit Deadline(std::chrono::milliseconds patience = std::chrono::seconds(is_full_size() ? 300
                                                                                             : 30))
      : end_(Clock::now() + patience) {}
  [[nodiscard]] bool is_over() const { return Clock::now() >= end_; }
  /// Throws, which fails the test, when the time is over.
  void check(const char* what) const {
    if (is_over()) throw std::runtime_error(std::string("waited in vain: ") + what);
  }

 private:
  Clock::time_point end_;
};

}  // namespace gimnet::stress
