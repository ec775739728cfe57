#pragma once

#include <cstdint>
#include <span>

#include "hub/shard/backoff.hpp"
#include "hub/shard/poller.hpp"

namespace gimnet::hub {

/// Guesses that what was ready in the last turn is ready again, where that is likely: who alone
/// writes message by message has written the next one while the last was passed on, and to read at
/// once costs less than to ask first (docs/performance.md, "Findings"). Thread safety: one shard.
class ReadyGuess {
 public:
  /// Who reads more than this in a turn gains nothing by sparing a wait.
  static constexpr std::uint64_t kReceivedMax = 16 * 1024;
  /// So long after a wait others are looked for again: turns that do much, whatever they read, are
  /// not repeated.
  static constexpr std::int64_t kBusyNsMax = 50'000;

  /// A wait has ended.
  void woke(std::int64_t now_ns) {
    woke_ns_ = now_ns;
    guessed_ = false;
  }

  /// A turn has ended that was told `ready` and read `received` bytes; has_rest: it left work for
  /// the next one. True: take that with the same `ready`. `now_ns` is called where the answer
  /// depends on it.
  template <class Clock>
  [[nodiscard]] bool same_again(std::span<const Ready> ready, std::uint64_t received, bool has_rest,
                                Clock now_ns) {
    if (guessed_) {
      if (received != 0) {
        backoff_.succeeded();
      } else {
        backoff_.failed();
      }
    }
    guessed_ = false;
    const bool alone =
        ready.size() == 1 && ready[0].token != Poller::kOwnToken && !ready[0].writable;
    if (!alone || has_rest || received == 0 || received > kReceivedMax || !backoff_.is_due())
      return false;
    guessed_ = now_ns() - woke_ns_ < kBusyNsMax;
    return guessed_;
  }

 private:
  Backoff backoff_;
  bool guessed_ = false;
  std::int64_t woke_ns_ = 0;
};

}  // namespace gimnet::hub
