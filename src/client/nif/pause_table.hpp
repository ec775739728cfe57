#pragma once

#include <cstddef>
#include <cstdint>
#include <map>

#include "base/ids.hpp"
#include "proto/frame/flow.hpp"
#include "proto/frame/frame_header.hpp"

namespace gimnet::nif {

/// Kind, lane and destination: what PAUSE is about, and what keeps its order.
[[nodiscard]] constexpr std::uint64_t stream_code(proto::Kind kind, std::uint8_t lane,
                                                  std::uint32_t dst) {
  return (static_cast<std::uint64_t>(kind) << 40) | (static_cast<std::uint64_t>(lane) << 32) | dst;
}

/// The destinations that a hub has paused. In order, which no choice of destinations can make slow.
/// Thread safety: guarded by its owner. Time is an argument.
class PauseTable {
 public:
  /// A hub that pauses more than this is not obeyed further.
  static constexpr std::size_t kPausesMax = 65'536;
  /// A pause about another hub holds for so long, unless it is said again: its RESUME may be lost
  /// with a link (docs/protocol.md, section 10).
  static constexpr std::int64_t kRemoteNs = 1'000'000'000;

  void pause(const proto::flow::Target& target, std::int64_t now_ns) {
    if (paused_.size() < kPausesMax || paused_.contains(code(target)))
      paused_[code(target)] = now_ns;
  }
  /// Lifts those about other hubs than `own` whose time is over. True: there were some.
  bool lift_overdue(HubId own, std::int64_t now_ns) {
    return std::erase_if(paused_, [&](const auto& each) {
             const NodeId dst{static_cast<std::uint32_t>(each.first)};
             return hub_of(dst) != own && now_ns - each.second >= kRemoteNs;
           }) != 0;
  }
  void resume(const proto::flow::Target& target) { paused_.erase(code(target)); }
  [[nodiscard]] bool is_paused(std::uint64_t stream) const {
    return !paused_.empty() && paused_.contains(stream);
  }
  [[nodiscard]] std::size_t size() const { return paused_.size(); }
  /// A new connection: the hub says again what it wants paused.
  void clear() { paused_.clear(); }

 private:
  static constexpr std::uint64_t code(const proto::flow::Target& target) {
    return stream_code(target.kind, static_cast<std::uint8_t>(target.lane), target.dst);
  }
  std::map<std::uint64_t, std::int64_t> paused_;  ///< since when
};

}  // namespace gimnet::nif
