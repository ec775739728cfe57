#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "generator/pattern.hpp"

namespace gimnet::perf {

/// Encoded messages, built once and sent again and again: before each round only the stamps, and
/// the message numbers of fragmented messages, are renewed.
class MessageBlock {
 public:
  std::vector<std::byte> bytes;

  /// The payload of a message of `stream` begins here: its stamp is renewed. A stream's first
  /// message is number 0.
  void mark_stamp(std::size_t position, StreamId stream) {
    if (stream >= next_sequences_.size()) next_sequences_.resize(stream + 1u);
    stamps_.push_back({static_cast<std::uint32_t>(position), stream});
    ends_.push_back(0);
  }
  /// A message number (u32) of the message that was marked last is here.
  void mark_number(std::size_t position) {
    numbers_.push_back(
        {static_cast<std::uint32_t>(position), static_cast<std::uint32_t>(stamps_.size() - 1)});
  }
  /// The message that was marked last ends here.
  void mark_end() { ends_.back() = bytes.size(); }

  [[nodiscard]] std::size_t message_count() const { return stamps_.size(); }
  [[nodiscard]] std::size_t message_bytes() const { return bytes.size() / stamps_.size(); }
  /// Where message `index` ends.
  [[nodiscard]] std::size_t message_end(std::size_t index) const { return ends_[index]; }

  /// Gives every message its next sequence. REQUIRES: nothing of the block is still being sent.
  void renew() {
    for (const auto& stamp : stamps_) {
      store_u64(bytes.data() + stamp.position,
                make_stamp(stamp.stream, next_sequences_[stamp.stream]++));
    }
    for (const auto& number : numbers_)
      store_u32(bytes.data() + number.position, next_number_ + number.message);
    next_number_ += static_cast<std::uint32_t>(stamps_.size());
  }

 private:
  struct Stamp {
    std::uint32_t position;
    StreamId stream;
  };
  struct Number {
    std::uint32_t position;
    std::uint32_t message;
  };
  std::vector<Stamp> stamps_;
  std::vector<Number> numbers_;
  std::vector<std::size_t> ends_;
  std::vector<std::uint64_t> next_sequences_;
  std::uint32_t next_number_ = 1;
};

}  // namespace gimnet::perf
