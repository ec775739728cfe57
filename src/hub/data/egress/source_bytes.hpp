#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "base/ids.hpp"

namespace gimnet::hub {

/// The bytes that wait in one lane, counted by the node that sent them, and the source that loses
/// messages when the lane is full. Sources share 16 counters, by a hash of their node ids. Bytes
/// that are never dropped for room (BLOCK, or a message that is being written) have 16 counters of
/// their own. Thread safety: one shard.
///
/// The source that loses is the one with the most bytes that may be dropped. It stays the same
/// until it lost a 32nd of the lane, or all others have left: if two sources had about the same,
/// it would change with every frame, and a run would have to be dropped frame by frame.
class SourceBytes {
 public:
  static constexpr std::size_t kSources = 16;
  /// Added to the place of an entry that is never dropped for room.
  static constexpr std::uint8_t kFixed = kSources;
  static constexpr std::uint64_t kStepsPerLane = 32;

  /// Neighbouring ids, as those of nodes that joined together, have counters of their own.
  [[nodiscard]] static std::uint8_t place_of(NodeId source) {
    return static_cast<std::uint8_t>((source.value() ^ (source.value() >> kHubShift)) % kSources);
  }

  void add(std::uint8_t place, std::uint32_t bytes) { bytes_[place] += bytes; }
  void take(std::uint8_t place, std::uint32_t bytes) { bytes_[place] -= bytes; }

  /// Bytes that may be dropped for room.
  [[nodiscard]] std::uint32_t droppable(std::uint8_t place) const { return bytes_[place]; }
  /// No other source has any.
  [[nodiscard]] bool is_alone(std::uint8_t place) const;
  /// At most one source has any.
  [[nodiscard]] bool at_most_one() const;
  /// The place with the most bytes of all sorts.
  [[nodiscard]] std::uint8_t fullest() const;

  /// A source has to be chosen before the next message is dropped.
  [[nodiscard]] bool choice_due() const { return !chosen_ || bytes_[loser_] <= floor_; }
  /// REQUIRES: a byte may be dropped.
  void choose(std::uint64_t lane_bytes);
  void forget_choice() { chosen_ = false; }
  /// The place of the source that loses. REQUIRES: choose() was called since the lane was empty.
  [[nodiscard]] std::uint8_t loser() const { return loser_; }
  /// It may be brought down to so many bytes before the next choice.
  [[nodiscard]] std::uint32_t floor() const { return floor_; }

 private:
  static constexpr unsigned kHubShift = 20;

  /// Modulo 2^32: a lane that holds more (its limit is configured) chooses another source, and
  /// still counts down to 0.
  std::array<std::uint32_t, 2 * kSources> bytes_{};
  std::uint32_t floor_ = 0;
  std::uint8_t loser_ = 0;
  bool chosen_ = false;
};

}  // namespace gimnet::hub
