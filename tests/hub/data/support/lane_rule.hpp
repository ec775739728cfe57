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
/// entries come one at a time, and are dropped one at a time. It holds as long as fewer than 64 of
/// them wait, and none joins the one before it. Thread safety: none.
class LaneRule {
 public:
  /// A message that is being written, and is never dropped.
  struct UnderWay {
    std::uint32_t size = 0;
    bool block = false;
  };
  /// A message, or several with one header.
  struct Entry {
    NodeId source;
    std::uint32_t size = 0;
    bool block = false;
    bool drop = false;  ///< policy DROP
    std::vector<std::string> payloads;
  };

  LaneRule(std::uint64_t lane_bytes, const UnderWay& under_way)
      : lane_bytes_(lane_bytes), under_way_(under_way) {}

  void come(Entry entry) {
    if (!entry.block && !entry.drop) {
      while (!fits(entry) && drop_one(entry)) continue;
    }
    if (entry.block || fits(entry) || waiting_.empty()) {
      waiting_.push_back(std::move(entry));
    } else {
      dropped += entry.payloads.size();
    }
  }
  [[nodiscard]] std::vector<std::string> left() const {
    std::vector<std::string> payloads;
    for (const Entry& each : waiting_)
      payloads.insert(payloads.end(), each.payloads.begin(), each.payloads.end());
    return payloads;
  }
  std::uint64_t dropped = 0;  ///< messages

 private:
  /// Messages sent with BLOCK take at most half of the lane from the others.
  [[nodiscard]] bool fits(const Entry& entry) const {
    std::uint64_t others = entry.size + (under_way_.block ? 0 : under_way_.size);
    for (const Entry& each : waiting_) others += each.block ? 0 : each.size;
    return others + std::min(block_bytes(), lane_bytes_ / 2) <= lane_bytes_;
  }
  [[nodiscard]] std::uint64_t block_bytes() const {
    std::uint64_t bytes = under_way_.block ? under_way_.size : 0;
    for (const Entry& each : waiting_) bytes += each.block ? each.size : 0;
    return bytes;
  }
  /// Bytes that may be dropped, by the place of the source. The first place wins a tie.
  [[nodiscard]] std::map<std::uint8_t, std::uint64_t> droppable() const {
    std::map<std::uint8_t, std::uint64_t> bytes;
    for (const Entry& each : waiting_) {
      if (!each.block) bytes[SourceBytes::place_of(each.source)] += each.size;
    }
    return bytes;
  }
  /// Drops the oldest of the source with the most, the new entry counted. It goes itself if no
  /// other of that source waits, or more than a quarter of the lane is sent with BLOCK.
  bool drop_one(const Entry& entry) {
    auto bytes = droppable();
    const std::uint8_t own = SourceBytes::place_of(entry.source);
    bytes[own] += entry.size;
    std::uint8_t loser = bytes.begin()->first;
    for (const auto& [place, each] : bytes) {
      if (each > bytes.at(loser)) loser = place;
    }
    if (loser == own && (block_bytes() > lane_bytes_ / 4 || bytes[own] == entry.size)) return false;
    const auto oldest = std::ranges::find_if(waiting_, [&](const Entry& each) {
      return !each.block && SourceBytes::place_of(each.source) == loser;
    });
    dropped += oldest->payloads.size();
    waiting_.erase(oldest);
    return true;
  }

  const std::uint64_t lane_bytes_;
  const UnderWay under_way_;
  std::vector<Entry> waiting_;
};

}  // namespace gimnet::hub::testing
