#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "hub/data/egress/source_bytes.hpp"

namespace gimnet::hub::testing {

/// The rule of docs/protocol.md, section 5, for one lane of a connection that takes nothing:
/// messages come one at a time, and are dropped one at a time. It holds as long as fewer than 64
/// entries wait. Thread safety: none.
class LaneRule {
 public:
  /// A message that is being written, and is never dropped.
  struct UnderWay {
    std::uint32_t size = 0;
    bool block = false;
  };
  struct Message {
    NodeId source;
    std::uint32_t size = 0;
    bool block = false;
    bool drop = false;  ///< policy DROP
    std::string payload;
  };

  LaneRule(std::uint64_t lane_bytes, const UnderWay& under_way)
      : lane_bytes_(lane_bytes), under_way_(under_way) {}

  void come(Message message) {
    if (!message.block && !message.drop) {
      while (!fits(message) && drop_one(message)) continue;
    }
    if (message.block || fits(message) || waiting_.empty()) {
      waiting_.push_back(std::move(message));
    } else {
      ++dropped;
    }
  }
  [[nodiscard]] std::vector<std::string> left() const {
    std::vector<std::string> payloads;
    for (const Message& each : waiting_) payloads.push_back(each.payload);
    return payloads;
  }
  std::uint64_t dropped = 0;

 private:
  /// Messages sent with BLOCK take at most half of the lane from the others.
  [[nodiscard]] bool fits(const Message& message) const {
    std::uint64_t others = message.size + (under_way_.block ? 0 : under_way_.size);
    for (const Message& each : waiting_) others += each.block ? 0 : each.size;
    return others + std::min(block_bytes(), lane_bytes_ / 2) <= lane_bytes_;
  }
  [[nodiscard]] std::uint64_t block_bytes() const {
    std::uint64_t bytes = under_way_.block ? under_way_.size : 0;
    for (const Message& each : waiting_) bytes += each.block ? each.size : 0;
    return bytes;
  }
  /// Bytes that may be dropped, by the place of the source. The first place wins a tie.
  [[nodiscard]] std::map<std::uint8_t, std::uint64_t> droppable() const {
    std::map<std::uint8_t, std::uint64_t> bytes;
    for (const Message& each : waiting_) {
      if (!each.block) bytes[SourceBytes::place_of(each.source)] += each.size;
    }
    return bytes;
  }
  /// Drops the oldest of the source with the most, which stays the same until it lost a 32nd of the
  /// lane or no other has any. While more than a quarter of the lane is sent with BLOCK, a new
  /// message of that source goes itself.
  bool drop_one(const Message& message) {
    auto bytes = droppable();
    if (bytes.empty()) return false;
    if (bytes.size() == 1 || !chosen_ || bytes[loser_] <= floor_) {
      loser_ = bytes.begin()->first;
      for (const auto& [place, each] : bytes) {
        if (each > bytes[loser_]) loser_ = place;
      }
      floor_ = bytes[loser_] - std::min(bytes[loser_], lane_bytes_ / 32);
      chosen_ = bytes.size() > 1;
    }
    if (block_bytes() > lane_bytes_ / 4 && SourceBytes::place_of(message.source) == loser_)
      return false;
    waiting_.erase(std::ranges::find_if(waiting_, [&](const Message& each) {
      return !each.block && SourceBytes::place_of(each.source) == loser_;
    }));
    ++dropped;
    return true;
  }

  const std::uint64_t lane_bytes_;
  const UnderWay under_way_;
  std::vector<Message> waiting_;
  std::uint8_t loser_ = 0;
  std::uint64_t floor_ = 0;
  bool chosen_ = false;
};

}  // namespace gimnet::hub::testing
