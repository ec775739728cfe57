#include "client/nif/spare_buffers.hpp"

#include <utility>

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

}  // namespace gimnet::nif
