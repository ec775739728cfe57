#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

#include "base/check.hpp"
#include "proto/frame/fragmenter.hpp"
#include "proto/frame/taken.hpp"

// The window of a fragmented UNICAST message, so that a gigabyte reaches a slow node without
// filling a queue on the way (docs/protocol.md, section 6). Thread safety: value types without
// threads or clocks; the owner guards them.

namespace gimnet::proto {

/// The bytes that a sender may have under way before the first TAKEN, and that a receiver allows
/// unless it decides otherwise.
inline constexpr std::uint32_t kWindowDefault = 1024 * 1024;

/// The sender's side, one per message.
class SendWindow {
 public:
  enum class Progress : std::uint8_t {
    going,     ///< there may be more room now
    finished,  ///< the receiver has all of it
    refused,   ///< the receiver does not want it: give up
    ignored,   ///< about another message, or not possible; nothing changed
  };

  SendWindow(std::uint32_t message, std::uint32_t total)
      : message_(message), total_(total), allowed_(std::min(total, kWindowDefault)) {}

  /// Bytes that may be sent now.
  [[nodiscard]] std::uint32_t room() const { return allowed_ > sent_ ? allowed_ - sent_ : 0; }
  [[nodiscard]] std::uint32_t sent() const { return sent_; }
  [[nodiscard]] std::uint32_t taken() const { return taken_; }

  /// REQUIRES: bytes <= room().
  void on_sent(std::uint32_t bytes) {
    GIMNET_CHECK(bytes <= room());
    sent_ += bytes;
  }

  /// Both numbers of TAKEN are cumulative: an old one that comes late changes nothing.
  Progress on_taken(const Taken& taken) {
    if (taken.message != message_) return Progress::ignored;
    if (taken.refuses()) return taken_ == 0 ? Progress::refused : Progress::ignored;
    if (taken.taken > sent_) return Progress::ignored;
    taken_ = std::max(taken_, taken.taken);
    allowed_ = std::max(allowed_, std::min(taken.allowed, total_));
    return taken_ == total_ ? Progress::finished : Progress::going;
  }

 private:
  std::uint32_t message_;
  std::uint32_t total_;
  std::uint32_t allowed_;
  std::uint32_t sent_ = 0;
  std::uint32_t taken_ = 0;
};

/// The receiver's side, one per message: says when a TAKEN is due, after each quarter of the window
/// and at the end.
class ReceiveWindow {
 public:
  ReceiveWindow(std::uint32_t message, std::uint32_t total, std::uint32_t window = kWindowDefault)
      : message_(message), total_(total), window_(std::max(window, 1u)) {}

  /// Should the sender be told that so many were received of the message in total, as Reassembled
  /// says?
  [[nodiscard]] bool due(std::uint32_t taken) const {
    return taken >= total_ || taken - told_ >= std::max(window_ / 4, 1u);
  }
  /// The TAKEN to send.
  [[nodiscard]] Taken tell(std::uint32_t taken) {
    told_ = taken;
    return current(taken);
  }

  /// Opens or narrows the window; what was allowed once stays allowed. Only between due() and
  /// tell(): with a window that nobody was told of, none might be due again.
  void set_window(std::uint32_t window) { window_ = std::max(window, 1u); }

  /// The answer to a message that is too large to take.
  [[nodiscard]] static constexpr Taken refusal(std::uint32_t message) { return {message, 0, 0}; }

 private:
  [[nodiscard]] Taken current(std::uint32_t taken) {
    const std::uint64_t allowed = std::min<std::uint64_t>(std::uint64_t{taken} + window_, total_);
    allowed_ = std::max(allowed_, static_cast<std::uint32_t>(allowed));
    return {message_, taken, allowed_};
  }

  std::uint32_t message_;
  std::uint32_t total_;
  std::uint32_t window_;
  std::uint32_t told_ = 0;
  std::uint32_t allowed_ = 0;
};

}  // namespace gimnet::proto
