#pragma once

#include <cstdint>
#include <functional>

namespace gimnet::nif::test {

/// While it lives, the monotonic clock of its thread says what `now_ns` answers. Not two at once in
/// one thread.
class OwnClock {
 public:
  explicit OwnClock(std::function<std::int64_t()> now_ns);
  ~OwnClock();
  OwnClock(const OwnClock&) = delete;
  OwnClock& operator=(const OwnClock&) = delete;

  [[nodiscard]] std::int64_t now_ns() const { return now_ns_(); }

 private:
  const std::function<std::int64_t()> now_ns_;
};

}  // namespace gimnet::nif::test
