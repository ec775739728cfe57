#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

#include "base/ids.hpp"
#include "proto/frame/frame_header.hpp"

namespace gimnet::hub {

/// A whole frame of kind LINK, NS or CTRL from this hub to a node, in lane 0.
[[nodiscard]] inline std::vector<std::byte> control_frame(proto::Kind kind, NodeId to, HubId hub,
                                                          std::span<const std::byte> payload) {
  proto::FrameHeader header;
  header.length = static_cast<std::uint32_t>(payload.size());
  header.dst = to.value();
  header.src = make_id<NodeId>(hub, kHubIndex).value();
  header.kind = kind;
  header.lane = static_cast<std::uint8_t>(proto::Lane::real_time);
  std::vector<std::byte> frame(proto::kHeaderSize + payload.size());
  proto::store_header(frame.data(), header);
  std::ranges::copy(payload, frame.begin() + proto::kHeaderSize);
  return frame;
}

/// Addresses such a frame to another node. REQUIRES: a whole header.
inline void set_destination(std::span<std::byte> frame, NodeId to) {
  proto::FrameHeader header = proto::load_header(frame.data());
  header.dst = to.value();
  proto::store_header(frame.data(), header);
}

}  // namespace gimnet::hub
