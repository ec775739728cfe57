#include "tests/client/nif/support/own_clock.hpp"

#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include <utility>

namespace {

thread_local constinit const gimnet::nif::test::OwnClock* t_clock = nullptr;

}  // namespace

/// In the place of the C library's, also for the standard library.
extern "C" int clock_gettime(clockid_t clock, struct timespec* time) noexcept {
  if (clock != CLOCK_MONOTONIC || t_clock == nullptr) {
    return static_cast<int>(::syscall(SYS_clock_gettime, clock, time));
  }
  // The answer may itself ask for the time.
  const auto* const own = std::exchange(t_clock, nullptr);
  const std::int64_t now_ns = own->now_ns();
  t_clock = own;
  time->tv_sec = now_ns / 1'000'000'000;
  time->tv_nsec = now_ns % 1'000'000'000;
  return 0;
}

namespace gimnet::nif::test {

OwnClock::OwnClock(std::function<std::int64_t()> now_ns) : now_ns_(std::move(now_ns)) {
  t_clock = this;
}

OwnClock::~OwnClock() { t_clock = nullptr; }

}  // namespace gimnet::nif::test
