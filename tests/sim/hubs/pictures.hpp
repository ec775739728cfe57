#pragma once

#include <chrono>
#include <cstdint>
#include <span>
#include <vector>

#include "proto/frame/frame_header.hpp"

namespace gimnet::sim::hubs {

/// Pictures that a node sends to another one, each a message in fragments, and those that came
/// whole. Thread safety: none.
class Pictures {
 public:
  /// No other frames of the simulation are of this kind.
  static constexpr auto kKind = static_cast<proto::Kind>(9);
  struct Seen {
    std::chrono::milliseconds shown_at;  ///< by the sender
    std::chrono::milliseconds came_at;
  };
  /// The payloads of the frames of one that is shown now. REQUIRES: 8 bytes at least.
  [[nodiscard]] std::vector<std::vector<std::byte>> cut(std::uint32_t bytes,
                                                        std::chrono::milliseconds now);
  void take(std::span<const std::byte> payload, std::chrono::milliseconds now);
  [[nodiscard]] const std::vector<Seen>& seen() const { return seen_; }

 private:
  std::uint32_t last_ = 0;
  std::uint32_t begun_ = 0;         ///< the number of the one that comes
  std::vector<std::byte> picture_;  ///< as far as it came
  std::vector<Seen> seen_;
};

}  // namespace gimnet::sim::hubs
