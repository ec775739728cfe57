#pragma once

#include <sys/epoll.h>

#include <array>
#include <cstdint>
#include <span>

#include "net/stream.hpp"

namespace gimnet::hub {

using net::Interest;

/// A descriptor that is ready. Errors show as readable: the next receive() tells.
struct Ready {
  std::uint64_t token = 0;
  bool readable = false;
  bool writable = false;
};

/// Waits for many descriptors: level-triggered epoll, so that a turn costs one wait, one receive
/// and one send, and nothing to arm again (docs/adr/0005-readiness-by-epoll.md has the measurement
/// against Boost.Asio's). Thread safety: one thread.
class Poller {
 public:
  Poller();
  ~Poller();
  Poller(const Poller&) = delete;
  Poller& operator=(const Poller&) = delete;

  /// Token of what the poller's owner adds for itself.
  static constexpr std::uint64_t kOwnToken = ~std::uint64_t{0};

  /// Returns false if the kernel refuses (out of memory or watches).
  [[nodiscard]] bool add(int descriptor, std::uint64_t token, Interest interest);
  /// Waited for nothing, a descriptor shows its end or error once, or not at all, until it is
  /// changed again.
  void change(int descriptor, std::uint64_t token, Interest interest);
  void remove(int descriptor);

  /// Waits up to `timeout_ms` (-1: for ever, or until a time that wait_until() was told). Valid
  /// until: the next call.
  [[nodiscard]] std::span<const Ready> wait(int timeout_ms);
  /// The same until a time, in ms of the monotonic clock, or kNow, or kNever. It may end earlier
  /// with nothing ready, as the time of an earlier call comes.
  [[nodiscard]] std::span<const Ready> wait_until(std::uint64_t at_ms);
  static constexpr std::uint64_t kNow = 0;
  static constexpr std::uint64_t kNever = UINT64_MAX;

 private:
  static constexpr std::size_t kReadyMax = 256;
  static constexpr std::uint64_t kTimerToken = kOwnToken - 1;

  void set_timer(std::uint64_t at_ms);

  int epoll_;
  /// A shard sleeps until its next tick, and is woken long before by a message. A timer that stays
  /// set costs less than a timeout that is set up and taken back each time: 2 % of a round trip on
  /// one processor.
  int timer_;
  std::uint64_t timer_at_ms_ = kNever;
  std::array<epoll_event, kReadyMax> events_;
  std::array<Ready, kReadyMax> ready_;
};

}  // namespace gimnet::hub
