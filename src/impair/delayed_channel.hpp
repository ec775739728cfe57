#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <random>
#include <span>
#include <vector>

#include "impair/impairment.hpp"

namespace gimnet::impair {

/// One way of a relayed connection: takes bytes when they come, and gives them, in order, when an
/// Impairment lets them out. It knows no clock; times are those of one monotonic clock, in
/// nanoseconds. Equal seeds and calls give equal results. Thread safety: none. Limit: room().
class DelayedChannel {
 public:
  static constexpr std::int64_t kNever = INT64_MAX;

  explicit DelayedChannel(std::uint64_t seed) : random_(seed) {}

  /// Bytes that may be put: 0 above queue_bytes().
  [[nodiscard]] std::size_t room(const Impairment& how) const;
  /// Takes bytes that came at `now_ns`; what is under way keeps the times that it has. REQUIRES:
  /// times never fall.
  void put(std::int64_t now_ns, const Impairment& how, std::span<const std::byte> bytes);

  /// The piece that is to be written at `now_ns` in one go; empty: none is due.
  [[nodiscard]] std::span<const std::byte> due(std::int64_t now_ns) const;
  /// When the next piece is due; kNever while nothing is held.
  [[nodiscard]] std::int64_t due_ns() const;
  /// `count` bytes of what is due were written. REQUIRES: it is not more.
  void took(std::size_t count);

  [[nodiscard]] std::uint64_t held() const { return held_; }

 private:
  struct Piece {
    std::int64_t due_ns;
    std::vector<std::byte> bytes;
  };

  [[nodiscard]] std::size_t piece_bytes(const Impairment& how);

  std::mt19937_64 random_;
  std::deque<Piece> pieces_;  ///< Limit: queue_bytes() of all together.
  std::size_t taken_ = 0;     ///< of the first piece
  std::uint64_t held_ = 0;
  std::int64_t line_free_ns_ = INT64_MIN;  ///< when the last byte has passed the bound of the rate
  std::int64_t last_due_ns_ = INT64_MIN;
};

}  // namespace gimnet::impair
