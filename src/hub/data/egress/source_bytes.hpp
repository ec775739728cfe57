#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "base/ids.hpp"

namespace gimnet::hub {

/// The bytes that wait in one lane, counted by the node that sent them. Sources share 16 counters,
/// by a hash of their node ids. Bytes that are never dropped for room (BLOCK, or a message that is
/// being written) have 16 counters of their own. Thread safety: one shard.
class SourceBytes {
 public:
  static constexpr std::size_t kSources = 16;
  /// Added to the place of an entry that is never dropped for room.
  static constexpr std::uint8_t kFixed = kSources;

  /// Neighbouring ids, as those of nodes that joined together, have counters of their own.
  [[nodiscard]] static std::uint8_t place_of(NodeId source) {
    return static_cast<std::uint8_t>((source.value() ^ (source.value() >> kHubShift)) % kSources);
  }

  void add(std::uint8_t place, std::uint32_t bytes) { bytes_[place] += bytes; }
  void take(std::uint8_t place, std::uint32_t bytes) { bytes_[place] -= bytes; }

  /// Bytes that are never dropped for room.
  [[nodiscard]] std::uint32_t fixed(std::uint8_t place) const { return bytes_[place + kFixed]; }
  /// So many sources have such bytes, or one if none has.
  [[nodiscard]] std::uint32_t fixed_sources() const;
  /// Those that have at most so many of them, as bits of their places.
  [[nodiscard]] std::uint32_t below(std::uint64_t bytes) const;
  /// Bytes that may be dropped for room.
  [[nodiscard]] std::uint32_t droppable(std::uint8_t place) const { return bytes_[place]; }
  /// The place of the source that loses a message when the lane is full: that with the most bytes
  /// that may be dropped for room.
  [[nodiscard]] std::uint8_t loser() const;
  /// The place with the most bytes of all sorts.
  [[nodiscard]] std::uint8_t fullest() const;

 private:
  static constexpr unsigned kHubShift = 20;

  /// Modulo 2^32: a lane that holds more (its limit is configured) chooses another source, and
  /// still counts down to 0.
  std::array<std::uint32_t, 2 * kSources> bytes_{};
};

}  // namespace gimnet::hub
