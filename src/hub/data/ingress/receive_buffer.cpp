#include "hub/data/ingress/receive_buffer.hpp"

#include <algorithm>
#include <cstring>

#include "base/check.hpp"
#include "proto/frame/frame_header.hpp"

namespace gimnet::hub {

[[gnu::always_inline]] inline void ReceiveBuffer::make_room() {
  // acquire pairs with the release in BufferPool::end_loan(): the other shard has read its last
  // byte.
  if (slab_ && slab_->references == 1 && slab_->lent.load(std::memory_order_acquire) == 0) {
    used_ = 0;
    pool_.unpin(*slab_.get());
  }
  if (!slab_ || kSlabReadBytes - used_ < kLeastRoom) {
    slab_ = pool_.take_slab();
    used_ = 0;
  }
}

std::span<std::byte> ReceiveBuffer::prepare(FrameTail& tail) {
  reading_.reset();
  if (tail.own) {
    reading_ = tail.buffer.share();
    begin_ = tail.begin;
    // A frame that began in the first kSlabReadBytes always ends in the slab; nothing begins behind
    // them. In a chunk there is only that frame.
    const std::uint32_t begins_below = reading_->kind == BufferKind::slab ? kSlabReadBytes : 0;
    const std::uint32_t limit = std::max(tail.begin + tail.needed, begins_below);
    const std::uint32_t filled = tail.begin + tail.size;
    GIMNET_CHECK(limit <= reading_->capacity && filled < limit);
    return {reading_->data + filled, limit - filled};
  }
  make_room();
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
  if (!tail.own) used_ = std::min(begin_ + size, kSlabReadBytes);
  forget(tail);
  return {begin, begin + size};
}

bool ReceiveBuffer::keep(FrameTail& tail, const std::byte* begin, const std::byte* end,
                         std::uint32_t needed) {
  const auto size = static_cast<std::uint32_t>(end - begin);
  if (size == 0) return true;
  tail.size = size;
  tail.needed = needed;
  // A slab for each of many slow senders would be far more than they sent.
  const bool may_stay = reading_->kind == BufferKind::chunk || own_slabs_ < kOwnSlabsMax;
  const bool large = needed > kLargeFrameBytes && size > proto::kHeaderSize;
  tail.own = size > kCopyTailBytes || (large && may_stay);
  const bool stays = tail.own && may_stay;
  if (stays) {
    tail.begin = static_cast<std::uint32_t>(begin - reading_->data);
    tail.buffer = reading_.share();
    // From here on only this connection reads into that slab.
    if (slab_.get() == reading_.get()) slab_.reset();
  } else {
    tail.begin = 0;
    tail.buffer = pool_.take_chunk(tail.own ? needed : size);
    std::memcpy(tail.buffer->data, begin, size);
    tally_.moved_tail_bytes += size;
  }
  tail_bytes_ += cost(tail);
  if (owns_slab(tail)) ++own_slabs_;
  if (tail_bytes_ <= tail_bytes_max_) return true;
  forget(tail);
  return false;
}

void ReceiveBuffer::keep_rest(FrameTail& tail, const std::byte* begin, const std::byte* end) {
  tail.size = static_cast<std::uint32_t>(end - begin);
  tail.needed = 0;
  if (tail.size > kSharedChunkBytes) {
    tail.begin = static_cast<std::uint32_t>(begin - reading_->data);
    tail.buffer = reading_.share();
    // A frame may have been begun at its end, and goes on there: nobody else reads into that slab
    // any more.
    if (slab_.get() == reading_.get()) slab_.reset();
  } else {
    tail.begin = 0;
    tail.buffer = pool_.take_chunk(tail.size);
    std::memcpy(tail.buffer->data, begin, tail.size);
    tally_.moved_tail_bytes += tail.size;
  }
  rest_bytes_ += cost(tail);
  ++rests_;
}

ReceiveBuffer::Received ReceiveBuffer::go_on(FrameTail& tail) {
  reading_.reset();
  const std::uint32_t size = tail.size;
  if (tail.buffer->kind == BufferKind::slab) {
    reading_ = tail.buffer.share();
    begin_ = tail.begin;
  } else {
    // In the chunk a frame that was begun at the end would have no room for its own.
    make_room();
    reading_ = slab_.share();
    begin_ = used_;
    used_ += size;
    std::memcpy(reading_->data + begin_, tail.buffer->data + tail.begin, size);
    tally_.moved_tail_bytes += size;
  }
  forget(tail);
  const std::byte* begin = reading_->data + begin_;
  return {begin, begin + size};
}

bool ReceiveBuffer::owns_slab(const FrameTail& tail) {
  return tail.own && tail.buffer->kind == BufferKind::slab;
}

std::uint32_t ReceiveBuffer::cost(const FrameTail& tail) {
  return tail.own || tail.is_rest() ? tail.buffer->capacity : tail.size;
}

void ReceiveBuffer::forget(FrameTail& tail) {
  if (tail.is_rest()) {
    rest_bytes_ -= cost(tail);
    --rests_;
  } else if (!tail.empty()) {
    tail_bytes_ -= cost(tail);
    if (owns_slab(tail)) --own_slabs_;
  }
  tail = FrameTail{};
}

}  // namespace gimnet::hub
