#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "proto/frame/frame_header.hpp"

namespace gimnet::fuzz {

/// Calls `take` with each frame that the bytes hold, made one that a hub would pass on from the
/// node `src` to `dst`: the kind is one that nodes may send, and the length is one that any hub
/// allows. What follows the last whole frame is left out.
template <typename Take>
void for_each_stranger_frame(std::span<const std::byte> bytes, std::uint32_t src, std::uint32_t dst,
                             Take take) {
  std::size_t at = 0;
  while (bytes.size() - at >= proto::kHeaderSize) {
    proto::FrameHeader header = proto::load_header(bytes.data() + at);
    if (header.length > proto::kFrameLengthDefault || header.frame_size() > bytes.size() - at)
      return;
    header.kind = static_cast<proto::Kind>(static_cast<std::uint8_t>(header.kind) & 15);
    if (header.kind == proto::Kind::report || header.kind == proto::Kind::flow)
      header.kind = proto::Kind::taken;
    header.src = src;
    if (header.kind == proto::Kind::unicast || header.kind == proto::Kind::taken) header.dst = dst;
    const auto given = bytes.subspan(at, header.frame_size());
    std::vector<std::byte> frame(given.begin(), given.end());
    proto::store_header(frame.data(), header);
    take(std::span<const std::byte>(frame));
    at += frame.size();
  }
}

}  // namespace gimnet::fuzz
