#include "client/nif/storage.hpp"

#include <utility>

#include "base/endian.hpp"
#include "proto/frame/frame_parser.hpp"

namespace gimnet::nif {

ByteBuffer SpareBuffers::take(std::size_t message_bytes, std::size_t aligned_at) {
  if (message_bytes < kMessageBytesMin) return ByteBuffer(aligned_at);
  const MutexLock lock(mutex_);
  if (buffers_.empty()) return ByteBuffer(aligned_at);
  ByteBuffer buffer = std::move(buffers_.back());
  buffers_.pop_back();
  bytes_ -= buffer.capacity();
  buffer.align(aligned_at);
  return buffer;
}

void SpareBuffers::give(ByteBuffer buffer) {
  if (buffer.capacity() < kMessageBytesMin) return;
  const MutexLock lock(mutex_);
  if (buffer.capacity() > kBytesMax - bytes_) return;
  buffer.clear();
  bytes_ += buffer.capacity();
  buffers_.push_back(std::move(buffer));
}

std::size_t SpareBuffers::bytes() const {
  const MutexLock lock(mutex_);
  return bytes_;
}

namespace {

/// At most a key stands between header and payload, as in most frames: they need not be taken apart
/// again.
bool is_plain(const proto::FrameHeader& header) {
  return header.kind != proto::Kind::list && !header.has(proto::kFlagExt | proto::kFlagFragment);
}

}  // namespace

nif_incoming incoming_of(const Item& item) {
  if (item.frame == nullptr) return static_cast<Record*>(item.storage)->incoming;
  const proto::FrameHeader header = proto::load_header(item.frame);
  nif_incoming in{};
  in.type = NIF_MESSAGE;
  in.from = header.src;
  in.to = header.kind == proto::Kind::list ? 0 : header.dst;
  in.kind = static_cast<std::uint8_t>(header.kind);
  in.lane = header.lane;
  in.policy = static_cast<std::uint8_t>(header.policy());
  in.flags = header.has(proto::kFlagReport) ? NIF_FLAG_REPORT : 0;
  in.arrival_ns = item.arrival_ns;
  in.epoch = item.epoch;
  in.text = "";
  in.storage = item.storage;
  if (is_plain(header)) {
    const std::byte* payload = item.frame + proto::kHeaderSize;
    in.size = header.length;
    if (header.has(proto::kFlagKeyed)) {
      in.key = load_le<std::uint64_t>(payload);
      in.flags |= NIF_FLAG_KEYED;
      payload += proto::kKeySize;
      in.size -= proto::kKeySize;
    }
    in.payload = payload;
    return in;
  }
  // As the frame was checked when it was taken, its own length bounds it and it parses again.
  const auto parsed = proto::parse_frame({item.frame, header.frame_size()}, proto::Origin::hub);
  if (!parsed) return in;
  in.payload = parsed->payload.data();
  in.size = parsed->payload.size();
  if (parsed->key) {
    in.key = *parsed->key;
    in.flags |= NIF_FLAG_KEYED;
  }
  if (!parsed->extensions.empty()) {
    in.extensions = parsed->extensions.data();
    in.extensions_size = parsed->extensions.size();
  }
  return in;
}

}  // namespace gimnet::nif

extern "C" void nif_release(nif_incoming* in) {
  if (in == nullptr || in->storage == nullptr) return;
  static_cast<gimnet::nif::Storage*>(in->storage)->release();
  in->storage = nullptr;
  in->payload = nullptr;
  in->extensions = nullptr;
  in->watched = nullptr;
  in->text = "";
}
