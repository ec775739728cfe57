#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include "generator/pattern.hpp"

namespace gimnet::perf {

/// What one client receives: every message is compared byte for byte with what was sent, in its
/// order. A gap in the sequence counts as lost; anything else that differs counts as wrong.
class Inbox {
 public:
  /// From now on messages of `stream` with payloads of `size` bytes are expected, beginning with
  /// `first_sequence`.
  void expect(StreamId stream, std::size_t size, std::uint64_t first_sequence = 0) {
    payload_ = pattern_payload(size);
    stream_ = stream;
    next_sequence_ = first_sequence;
    piece_end_ = 0;
  }

  /// A whole message.
  void on_message(std::span<const std::byte> payload) {
    if (payload.size() != payload_.size() ||
        load_u64(payload.data() + 8) != load_u64(payload_.data() + 8) ||
        (payload.size() > 16 && !same(payload, 16))) {
      ++wrong_;
      return;
    }
    if (take_stamp(load_u64(payload.data()))) ++delivered_;
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
    if (offset == 0) piece_stamp_ = load_u64(piece.data());
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
