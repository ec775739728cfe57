#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include "fuzz/support/fuzz_input.hpp"
#include "proto/frame/frame_parser.hpp"

namespace gimnet::fuzz {

/// The counts of a subscriber of a paced group, as its library has them. Ends in an abort where it
/// gets a message out of order or twice.
class PacedCounts {
 public:
  /// Stands before the sequence number in the messages of which the order is known.
  static constexpr std::uint64_t kMark = 0x70616365'6d61726bu;
  struct Message {
    std::uint64_t mark = kMark;
    std::uint64_t sequence = 0;
  };

  /// The last message may come again, as far as up to this one.
  void allow_repeats(std::uint64_t up_to) { repeats_up_to_ = up_to; }
  /// The group is another one.
  void begin() { *this = PacedCounts{}; }
  /// The counts of this connection begin at 0.
  void begin_epoch() { ended_ = credited_ = 0; }
  [[nodiscard]] std::uint64_t credit(std::uint64_t messages) {
    credited_ = std::min(ended_, credited_ + messages);
    return credited_;
  }

  void take(const proto::FrameView& frame) {
    if (frame.header.has(proto::kFlagFragment) && !frame.ends_message()) return;
    ++ended_;
    ++taken_;
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

  /// Messages of the group, whatever they count in.
  [[nodiscard]] std::uint64_t taken() const { return taken_; }
  [[nodiscard]] std::uint64_t last() const { return last_; }

 private:
  std::uint64_t ended_ = 0;     ///< messages of this epoch
  std::uint64_t credited_ = 0;  ///< of them
  std::uint64_t taken_ = 0;
  std::uint64_t last_ = 0;
  std::uint64_t repeats_up_to_ = 0;
};

}  // namespace gimnet::fuzz
