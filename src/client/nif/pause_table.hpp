#pragma once

#include <cstddef>
#include <cstdint>
#include <set>

#include "proto/frame/flow.hpp"
#include "proto/frame/frame_header.hpp"

namespace gimnet::nif {

/// Kind, lane and destination: what PAUSE is about, and what keeps its order.
[[nodiscard]] constexpr std::uint64_t stream_code(proto::Kind kind, std::uint8_t lane,
                                                  std::uint32_t dst) {
  return (static_cast<std::uint64_t>(kind) << 40) | (static_cast<std::uint64_t>(lane) << 32) | dst;
}

/// The destinations that the hub has paused. In order, which no choice of destinations can make
/// slow. Thread safety: guarded by its owner.
class PauseTable {
 public:
  /// A hub that pauses more than this is not obeyed further.
  static constexpr std::size_t kPausesMax = 65'536;

  void pause(const proto::flow::Target& target) {
    if (paused_.size() < kPausesMax) paused_.insert(code(target));
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
  std::set<std::uint64_t> paused_;
};

}  // namespace gimnet::nif
