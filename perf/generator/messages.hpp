#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "base/endian.hpp"

// Messages of a measurement. A payload is 8 bytes of stamp (stream << 48 | sequence), then a fixed
// pseudo-random pattern. So a block of messages is built once, only stamps are renewed, and a
// receiver checks every byte with one comparison.

namespace gimnet::perf {

inline constexpr std::size_t kStampBytes = 8;
inline constexpr std::size_t kPayloadBytesMin = 16;
inline constexpr std::size_t kPayloadBytesMax = 1024 * 1024;

/// Numbers the messages of one sender to one target.
using StreamId = std::uint16_t;

[[nodiscard]] constexpr std::uint64_t make_stamp(StreamId stream, std::uint64_t sequence) {
  return (static_cast<std::uint64_t>(stream) << 48) | sequence;
}

/// A payload of `size` bytes with stamp 0. REQUIRES: kPayloadBytesMin <= size <= kPayloadBytesMax.
[[nodiscard]] inline std::span<const std::byte> pattern_payload(std::size_t size) {
  static const std::vector<std::byte> pattern = [] {
    std::vector<std::byte> bytes(kPayloadBytesMax);
    std::uint64_t state = 0x9E3779B97F4A7C15ull;
    for (std::size_t at = kStampBytes; at < bytes.size(); at += 8) {
      state ^= state << 13;  // Marsaglia's xorshift64
      state ^= state >> 7;
      state ^= state << 17;
      store_le(bytes.data() + at, state);
    }
    return bytes;
  }();
  return {pattern.data(), size};
}

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
  /// The end of message `index` in bytes.
  [[nodiscard]] std::size_t message_end(std::size_t index) const { return ends_[index]; }

  /// Gives every message its next sequence. REQUIRES: nothing of the block is still being sent.
  void renew() {
    for (const auto& stamp : stamps_) {
      store_le(bytes.data() + stamp.position,
               make_stamp(stamp.stream, next_sequences_[stamp.stream]++));
    }
    for (const auto& number : numbers_)
      store_le(bytes.data() + number.position, next_number_ + number.message);
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

/// The messages that one client receives: each is compared byte for byte with what was sent, in its
/// order. A gap in the sequence counts as lost; anything else that differs counts as wrong.
class Inbox {
 public:
  /// From now on messages of `stream` with payloads of `size` bytes are expected, from the first
  /// on.
  void expect(StreamId stream, std::size_t size) {
    payload_ = pattern_payload(size);
    stream_ = stream;
    next_sequence_ = 0;
    piece_end_ = 0;
  }

  /// A whole message.
  void on_message(std::span<const std::byte> payload) {
    if (payload.size() != payload_.size() ||
        load_le<std::uint64_t>(payload.data() + 8) != load_le<std::uint64_t>(payload_.data() + 8) ||
        (payload.size() > 16 && !same(payload, 16))) {
      ++wrong_;
      return;
    }
    if (take_stamp(load_le<std::uint64_t>(payload.data()))) ++delivered_;
  }

  /// A part of a message that travels in pieces; `number` tells those of one message from those of
  /// others, which are the same but for their stamps, and `total` is the size of the whole message.
  void on_piece(std::uint32_t number, std::size_t offset, std::size_t total,
                std::span<const std::byte> piece) {
    const std::size_t skipped = offset == 0 ? kStampBytes : 0;
    if (offset == 0) {
      piece_end_ = 0;
      piece_number_ = number;
    }
    if (number != piece_number_ || offset != piece_end_ || total != payload_.size() ||
        piece.size() < skipped + 1 || offset + piece.size() > total ||
        !same(piece, skipped, offset)) {
      ++wrong_;
      piece_end_ = 0;
      return;
    }
    if (offset == 0) piece_stamp_ = load_le<std::uint64_t>(piece.data());
    piece_end_ = offset + piece.size();
    if (piece_end_ == total && take_stamp(piece_stamp_)) ++delivered_;
  }

  void on_wrong() { ++wrong_; }

  [[nodiscard]] std::uint64_t delivered() const { return delivered_; }
  [[nodiscard]] std::uint64_t lost() const { return lost_; }
  [[nodiscard]] std::uint64_t wrong() const { return wrong_; }
  /// Messages of which it is known what became of them.
  [[nodiscard]] std::uint64_t settled() const { return delivered_ + lost_; }

 private:
  [[nodiscard]] bool same(std::span<const std::byte> bytes, std::size_t from,
                          std::size_t offset = 0) const {
    return std::memcmp(bytes.data() + from, payload_.data() + offset + from, bytes.size() - from) ==
           0;
  }

  bool take_stamp(std::uint64_t stamp) {
    const std::uint64_t expected = make_stamp(stream_, next_sequence_);
    if (stamp != expected) [[unlikely]] {
      if (stamp < expected || (stamp >> 48) != stream_) {
        ++wrong_;
        return false;
      }
      lost_ += stamp - expected;
      next_sequence_ += stamp - expected;
    }
    ++next_sequence_;
    return true;
  }

  std::span<const std::byte> payload_;
  std::uint64_t next_sequence_ = 0;
  std::uint64_t delivered_ = 0;
  std::uint64_t lost_ = 0;
  std::uint64_t wrong_ = 0;
  std::uint64_t piece_stamp_ = 0;
  std::size_t piece_end_ = 0;
  std::uint32_t piece_number_ = 0;
  StreamId stream_ = 0;
};

}  // namespace gimnet::perf
