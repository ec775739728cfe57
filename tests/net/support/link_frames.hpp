#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "proto/control/link.hpp"
#include "proto/frame/frame_header.hpp"

// The bytes of a handshake.

namespace gimnet::net {

/// The bytes of a frame of kind LINK.
inline std::vector<std::byte> link_frame(std::span<const std::byte> payload) {
  proto::FrameHeader header;
  header.kind = proto::Kind::link;
  header.length = static_cast<std::uint32_t>(payload.size());
  std::vector<std::byte> bytes(proto::kHeaderSize);
  proto::store_header(bytes.data(), header);
  bytes.insert(bytes.end(), payload.begin(), payload.end());
  return bytes;
}

/// The opening and a message of kind LINK: HELLO of a dialler; WELCOME or GOODBYE of a hub.
template <class Message>
inline std::vector<std::byte> opening_and(const Message& message) {
  std::vector<std::byte> bytes(proto::kOpening.begin(), proto::kOpening.end());
  const std::vector<std::byte> frame = link_frame(proto::encode(message));
  bytes.insert(bytes.end(), frame.begin(), frame.end());
  return bytes;
}

}  // namespace gimnet::net
