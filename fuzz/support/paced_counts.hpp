#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include "fuzz/support/fuzz_input.hpp"
#include "proto/frame/frame_parser.hpp"

namespace gimnet::fuzz {

/// What a subscriber of a paced group counts, as its library would. Ends in an abort where it gets
/// more than its window, or a message out of order or twice.
class PacedCounts {
 public:
  /// Stands before the sequence number in the messages of which the order is known.
  static constexpr std::uint64_t kMark = 0x70616365'6d61726bu;
  struct Message {
    std::uint64_t mark = kMark;
    std::uint64_t sequence = 0;
  };

  /// A subscription began or has another window; 0: none.
  void set_window(std::uint64_t window) {
    window_most_ = window == 0 ? kNoWindow : std::max(window_most_, window);
  }
  /// The last message may come again, as far as up to this one.
  void allow_repeats(std::uint64_t up_to) { repeats_up_to_ = up_to; }
  /// The group is another one.
  void begin(std::uint64_t window) {
    *this = PacedCounts{};
    set_window(window);
  }
  /// The counts of this connection begin at 0.
  void begin_epoch(std::uint64_t window) {
    ended_ = credited_ = window_most_ = 0;
    set_window(window);
  }
  /// Said more than there was: what its hub makes of that need not be what it counts.
  void lied() { window_most_ = kNoWindow; }
  [[nodiscard]] std::uint64_t credit(std::uint64_t messages) {
    credited_ = std::min(ended_, credited_ + messages);
    return credited_;
  }

  void take(const proto::FrameView& frame) {
    if (frame.header.has(proto::kFlagFragment) && !frame.ends_message()) return;
    ++ended_;
    FUZZ_MUST(window_most_ == kNoWindow || ended_ - credited_ <= window_most_);
    const bool whole = !frame.header.has(proto::kFlagFragment);
    const std::span<const std::byte> payload = frame.payload;
    Message message;
    if (payload.size() < sizeof message) return;
    // The last fragment of a message says its number where a whole one has it at its beginning.
    std::memcpy(&message, payload.data() + (whole ? 0 : payload.size() - sizeof message),
                sizeof message);
    if (message.mark != kMark) return;
    FUZZ_MUST(message.sequence > last_ || (message.sequence == last_ && last_ <= repeats_up_to_));
    last_ = message.sequence;
  }

  [[nodiscard]] std::uint64_t ended() const { return ended_; }
  [[nodiscard]] std::uint64_t last() const { return last_; }

 private:
  static constexpr std::uint64_t kNoWindow = UINT64_MAX;
  std::uint64_t window_most_ = 0;
  std::uint64_t ended_ = 0;     ///< messages of this epoch
  std::uint64_t credited_ = 0;  ///< of them
  std::uint64_t last_ = 0;
  std::uint64_t repeats_up_to_ = 0;
};

}  // namespace gimnet::fuzz
