#include "proto/frame/frame_builder.hpp"

#include <cstring>

#include "base/check.hpp"
#include "base/endian.hpp"
#include "proto/frame/extensions.hpp"

namespace gimnet::proto {
namespace {

FrameHeader complete_header(const FrameParts& parts, std::size_t prefix) {
  const std::size_t length = prefix - kHeaderSize + parts.payload_size;
  GIMNET_CHECK(length <= UINT32_MAX);
  FrameHeader header = parts.header;
  header.length = static_cast<std::uint32_t>(length);
  if (!parts.recipients.empty()) header.dst = static_cast<std::uint32_t>(parts.recipients.size());
  header.flags &= static_cast<std::uint8_t>(~(kFlagExt | kFlagFragment | kFlagKeyed));
  if (!parts.extensions.empty()) header.flags |= kFlagExt;
  if (parts.fragment) header.flags |= kFlagFragment;
  if (parts.key) header.flags |= kFlagKeyed;
  return header;
}

}  // namespace

std::size_t prefix_size(const FrameParts& parts) {
  std::size_t size = kHeaderSize + 4 * parts.recipients.size();
  if (!parts.extensions.empty()) size += kExtensionsPrefixSize + parts.extensions.size();
  if (parts.fragment) size += kFragmentHeaderSize;
  if (parts.key) size += kKeySize;
  return size;
}

std::size_t write_prefix(const FrameParts& parts, std::span<std::byte> memory) {
  const std::size_t size = prefix_size(parts);
  if (memory.size() < size) return 0;
  std::byte* at = memory.data();
  store_header(at, complete_header(parts, size));
  at += kHeaderSize;
  for (const NodeId id : parts.recipients) {
    store_le(at, id.value());
    at += 4;
  }
  if (!parts.extensions.empty()) {
    GIMNET_CHECK(parts.extensions.size() <= UINT16_MAX);
    store_le(at, static_cast<std::uint16_t>(parts.extensions.size()));
    std::memcpy(at + kExtensionsPrefixSize, parts.extensions.data(), parts.extensions.size());
    at += kExtensionsPrefixSize + parts.extensions.size();
  }
  if (parts.fragment) {
    store_fragment_header(at, *parts.fragment);
    at += kFragmentHeaderSize;
  }
  if (parts.key) store_le(at, *parts.key);
  return size;
}

std::size_t write_frame(const FrameParts& parts, std::span<const std::byte> payload,
                        std::span<std::byte> memory) {
  FrameParts whole = parts;
  whole.payload_size = payload.size();
  const std::size_t prefix = prefix_size(whole);
  if (memory.size() < prefix || memory.size() - prefix < payload.size()) return 0;
  const std::size_t written = write_prefix(whole, memory);
  if (!payload.empty()) std::memcpy(memory.data() + written, payload.data(), payload.size());
  return written + payload.size();
}

}  // namespace gimnet::proto
