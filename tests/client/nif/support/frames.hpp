#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "client/nif/send_queue.hpp"
#include "gimnet/nif.h"
#include "proto/frame/frame_builder.hpp"

// Frames into a send queue and out again.

namespace gimnet::nif::test {

inline std::vector<std::byte> frame_of(const proto::FrameHeader& header, std::string_view payload) {
  proto::FrameParts parts;
  parts.header = header;
  std::vector<std::byte> frame(proto::kHeaderSize + payload.size());
  static_cast<void>(proto::write_frame(parts, std::as_bytes(std::span(payload)), frame));
  return frame;
}

inline void put(SendQueue& queue, std::uint8_t lane, std::string_view payload,
                proto::Policy policy = proto::Policy::kind_default) {
  proto::FrameHeader header;
  header.lane = lane;
  header.flags = static_cast<std::uint8_t>(policy);
  const auto frame = frame_of(header, payload);
  std::memcpy(queue.append(lane, frame.size()).data(), frame.data(), frame.size());
}

inline void put_latest(SendQueue& queue, std::string_view payload, std::uint64_t key) {
  proto::FrameHeader header;
  header.flags = static_cast<std::uint8_t>(proto::Policy::latest);
  const auto frame = frame_of(header, payload);
  const auto stream = latest_stream_of(header, key);
  std::memcpy(queue.append_latest(header.lane, frame.size(), stream).data(), frame.data(),
              frame.size());
}

inline void put_control(SendQueue& queue, std::string_view payload) {
  proto::FrameHeader header;
  header.kind = proto::Kind::flow;
  const auto frame = frame_of(header, payload);
  std::memcpy(queue.append_control(frame.size()).data(), frame.data(), frame.size());
}

inline void append(std::vector<std::byte>& to, const std::vector<std::byte>& more) {
  to.insert(to.end(), more.begin(), more.end());
}

/// One write of which the kernel takes at most `bytes_max`.
inline std::vector<std::byte> write_once(SendQueue& queue, std::size_t bytes_max) {
  std::vector<std::byte> written;
  for (const iovec& piece : queue.gather()) {
    const std::size_t bytes = std::min(piece.iov_len, bytes_max - written.size());
    const auto* begin = static_cast<const std::byte*>(piece.iov_base);
    written.insert(written.end(), begin, begin + bytes);
  }
  queue.commit(written.size());
  return written;
}

/// Writes until nothing waits, at most `bytes_max` at a time.
inline std::vector<std::byte> write_all(SendQueue& queue, std::size_t bytes_max = SIZE_MAX) {
  std::vector<std::byte> written;
  while (!queue.all_written()) append(written, write_once(queue, bytes_max));
  return written;
}

/// The frames' payloads; a last one that is incomplete is left out.
inline std::vector<std::string> payloads(const std::vector<std::byte>& bytes) {
  std::vector<std::string> found;
  for (std::size_t at = 0; at + proto::kHeaderSize <= bytes.size();) {
    const proto::FrameHeader header = proto::load_header(bytes.data() + at);
    if (at + header.frame_size() > bytes.size()) break;
    const auto* payload = reinterpret_cast<const char*>(bytes.data() + at + proto::kHeaderSize);
    found.emplace_back(payload, header.length);
    at += header.frame_size();
  }
  return found;
}

}  // namespace gimnet::nif::test
