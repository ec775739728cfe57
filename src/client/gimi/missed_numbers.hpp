#pragma once

#include <cstdint>

namespace gimnet::gimi {

/// Counts the messages of one stream that did not come, by their numbers. Keeps the highest number
/// and which of the last 64 are missing, so that one that comes late is taken off again: while ways
/// between hubs change, messages of two ways mix. A value type. Numbers go on at 0 behind 2^32 - 1.
class MissedNumbers {
 public:
  /// The last numbers of which it is known whether they came. What comes later stays counted.
  static constexpr std::uint32_t kWindow = 64;

  /// Another stream begins: its first message says where it stands. The count goes on.
  void begin(std::uint32_t number) {
    highest_ = number;
    missing_ = 0;
  }
  /// A message came. True: the count is another one now.
  bool take(std::uint32_t number) {
    const std::uint32_t ahead = number - highest_;
    if (is_ahead(ahead)) {
      advance(ahead);
      count_ += ahead - 1;
      return ahead > 1;
    }
    const std::uint32_t behind = highest_ - number;
    const std::uint64_t its_bit = behind < kWindow ? std::uint64_t{1} << behind : 0;
    if ((missing_ & its_bit) == 0) return false;  // it came before, or is too old
    missing_ &= ~its_bit;
    --count_;
    return true;
  }
  /// A message will not come. True: as take().
  bool miss(std::uint32_t number) {
    const std::uint32_t ahead = number - highest_;
    if (!is_ahead(ahead)) return false;  // it is counted already
    advance(ahead);
    missing_ |= 1;
    count_ += ahead;
    return true;
  }

  [[nodiscard]] std::uint32_t highest() const { return highest_; }
  /// The messages missed of all streams.
  [[nodiscard]] std::uint64_t count() const { return count_; }

 private:
  [[nodiscard]] static bool is_ahead(std::uint32_t step) { return step != 0 && step <= INT32_MAX; }
  /// The numbers between the highest one and the new one are missing. REQUIRES: is_ahead(step).
  void advance(std::uint32_t step) {
    highest_ += step;
    constexpr std::uint64_t kAllBefore = ~std::uint64_t{1};
    missing_ = step < kWindow ? missing_ << step | (((std::uint64_t{1} << step) - 1) & kAllBefore)
                              : kAllBefore;
  }

  std::uint32_t highest_ = 0;
  std::uint64_t missing_ = 0;  ///< bit n: `highest_ - n` did not come
  std::uint64_t count_ = 0;
};

}  // namespace gimnet::gimi
