#pragma once

#include <cstdint>

#include "hub/data/egress/lane_queue.hpp"
#include "proto/frame/flow.hpp"

namespace gimnet::hub {

/// The frames that were dropped because a lane was full, since the connection's node was told last,
/// and the node of which most bytes waited in that lane at the latest drop. Thread safety: one
/// shard.
class UntoldLosses {
 public:
  /// `lost` does not wait in the lane, or no longer.
  void add(const Entry& lost, LaneQueue& lane, proto::DropReason reason) {
    frames_ += lost.frames;
    reason_ = reason;
    const std::uint8_t fullest = lane.sources().fullest();
    if (const NodeId sender{lost.run.header().src}; SourceBytes::place_of(sender) == fullest) {
      source_ = sender;
    } else if (SourceBytes::place_of(source_) != fullest || source_ == NodeId{}) {
      source_ = lane.source_at(fullest);
    }
  }
  [[nodiscard]] proto::flow::Dropped message() const { return {reason_, source_, frames_}; }

 private:
  std::uint64_t frames_ = 0;
  NodeId source_;
  proto::DropReason reason_ = proto::DropReason::none;
};

}  // namespace gimnet::hub
