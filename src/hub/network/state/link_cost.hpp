#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <optional>

namespace gimnet::hub {

/// The cost of a link: the configured one, or 10 plus the lowest round trip in ms since it came up.
/// A measured cost only falls, and only by a quarter at a time: a cost that followed the load would
/// move the load to and fro. Thread safety: none. Limits: 1 to 65,535.
class LinkCost {
 public:
  static constexpr std::uint16_t kLeastMeasured = 10;
  /// Until then a link costs as much as one of a second: measured ones go first.
  static constexpr std::uint16_t kUnmeasured = kLeastMeasured + 1'000;
  static constexpr std::uint16_t kMost = 65'535;

  LinkCost() = default;
  /// REQUIRES: configured > 0.
  explicit LinkCost(std::uint16_t configured) : cost_(configured), fixed_(true) {}

  /// Nothing: no round trip was measured yet.
  [[nodiscard]] std::optional<std::uint16_t> value() const { return cost_; }
  /// True: the cost is another one now.
  bool note_round_trip(std::chrono::nanoseconds round_trip) {
    if (fixed_) return false;
    const auto ms = std::chrono::ceil<std::chrono::milliseconds>(round_trip).count();
    const auto measured =
        static_cast<std::uint16_t>(std::clamp<std::int64_t>(kLeastMeasured + ms, 1, kMost));
    if (cost_ && std::uint32_t{4} * measured > std::uint32_t{3} * *cost_) return false;
    cost_ = measured;
    return true;
  }

 private:
  std::optional<std::uint16_t> cost_;
  bool fixed_ = false;
};

}  // namespace gimnet::hub
