#include "hub/data/ingress/receive_buffer.hpp"

#include <algorithm>
#include <cstring>

#include "base/check.hpp"

namespace gimnet::hub {

std::span<std::byte> ReceiveBuffer::prepare(FrameTail& tail) {
  reading_.reset();
  if (tail.owns_slab) {
    reading_ = tail.buffer.share();
    begin_ = tail.begin;
    // A frame that began in the first kSlabReadBytes always ends in the slab; nothing begins behind them.
    const std::uint32_t limit = std::max(tail.begin + tail.needed, kSlabReadBytes);
    const std::uint32_t filled = tail.begin + tail.size;
    GIMNET_CHECK(limit <= reading_->capacity && filled < limit);
    return {reading_->data + filled, limit - filled};
  }
  // acquire pairs with the release in BufferPool::end_loan(): the other shard has read its last byte.
  if (slab_ && slab_->references == 1 && slab_->lent.load(std::memory_order_acquire) == 0) {
    used_ = 0;
    pool_.unpin(*slab_.get());
  }
  if (!slab_ || kSlabReadBytes - used_ < kLeastRoom) {
    slab_ = pool_.take_slab();
    used_ = 0;
  }
  reading_ = slab_.share();
  begin_ = used_;
  if (!tail.empty()) std::memcpy(slab_->data + used_, tail.buffer->data + tail.begin, tail.size);
  const std::uint32_t limit = std::max(begin_ + tail.needed, kSlabReadBytes);
  const std::uint32_t filled = begin_ + tail.size;
  GIMNET_CHECK(limit <= slab_->capacity && filled < limit);
  return {slab_->data + filled, limit - filled};
}

ReceiveBuffer::Received ReceiveBuffer::commit(FrameTail& tail, std::size_t bytes) {
  const std::byte* begin = reading_->data + begin_;
  const std::uint32_t size = tail.size + static_cast<std::uint32_t>(bytes);
  if (!tail.owns_slab) used_ = std::min(begin_ + size, kSlabReadBytes);
  forget(tail);
  return {begin, begin + size};
}

bool ReceiveBuffer::keep(FrameTail& tail, const std::byte* begin, const std::byte* end, std::uint32_t needed) {
  const auto size = static_cast<std::uint32_t>(end - begin);
  if (size == 0) return true;
  const bool own = size > kCopyTailBytes;
  const std::uint32_t cost = own ? reading_->capacity : size;
  if (tail_bytes_ + cost > tail_bytes_max_) return false;
  tail_bytes_ += cost;
  tail.size = size;
  tail.needed = needed;
  tail.owns_slab = own;
  if (own) {
    tail.begin = static_cast<std::uint32_t>(begin - reading_->data);
    tail.buffer = reading_.share();
    // From here on only this connection reads into that slab.
    if (slab_.get() == reading_.get()) slab_.reset();
  } else {
    tail.begin = 0;
    tail.buffer = pool_.take_chunk(size);
    std::memcpy(tail.buffer->data, begin, size);
    tally_.moved_tail_bytes += size;
  }
  return true;
}

void ReceiveBuffer::forget(FrameTail& tail) {
  if (!tail.empty()) tail_bytes_ -= tail.owns_slab ? tail.buffer->capacity : tail.size;
  tail = FrameTail{};
}

}  // namespace gimnet::hub
