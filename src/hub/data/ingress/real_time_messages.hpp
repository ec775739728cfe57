#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace gimnet::hub {

/// Fragmented lane 0 messages of one connection that have begun: whether they were moved to lane 1,
/// since a message is moved whole or not at all, and how much of what was counted when they began
/// is left. Where more are begun at a time, the one that began longest ago is forgotten: a sender
/// may give up any without a word. Thread safety: one shard.
class RealTimeMessages {
 public:
  static constexpr std::size_t kMessagesMax = 8;

  struct Message {
    std::uint32_t number = 0;
    bool known = false;
    bool moved = false;
    std::uint64_t left_bytes = 0;  ///< of frames that were counted already
  };

  /// nullptr: not known. Valid until: the next begin().
  [[nodiscard]] Message* find(std::uint32_t number) {
    for (Message& message : messages_) {
      if (message.known && message.number == number) return &message;
    }
    return nullptr;
  }
  void begin(const Message& message) {
    Message* place = find(message.number);
    if (place == nullptr) {
      place = &messages_[next_];
      next_ = (next_ + 1) % kMessagesMax;
    }
    *place = message;
  }

 private:
  std::array<Message, kMessagesMax> messages_{};
  std::size_t next_ = 0;  ///< whose place the next one gets: all are taken in turns
};

}  // namespace gimnet::hub
