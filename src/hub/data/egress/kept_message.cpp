#include "hub/data/egress/kept_message.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

namespace gimnet::hub {

void KeptMessage::append(const Run& frame, bool shared, BudgetLease& budget,
                         EgressContext& context) {
  const bool small = frame.size < kCopyBytesMax && !shared;
  const bool by_copy = must_copy(*frame.buffer.get(), small, budget);
  Run piece = by_copy ? copy(frame, budget.scarce(), context) : frame.share();
  context.pool.pin(*piece.buffer.get(), budget);
  add(std::move(piece));
}

void KeptMessage::add(Run piece) {
  frames_ += piece.frames;
  bytes_ += piece.size;
  Run& last = more_.empty() ? first_ : more_.back();
  if (first_.frames == 0) {
    first_ = std::move(piece);
  } else if (!last.extend(piece)) {
    more_.push_back(std::move(piece));
  }
}

Run KeptMessage::copy(const Run& frame, bool scarce, EgressContext& context) {
  if (!chunk_ || chunk_->capacity - chunk_used_ < frame.size) {
    // The frames of a large message share chunks; a small message takes what it needs.
    const bool exact = scarce && frame.size >= BufferPool::kExactBytesMin;
    chunk_ = exact ? context.pool.take_exact(frame.size)
                   : context.pool.take_chunk(frames_ == 0 ? frame.size : kCopyBytesMax);
    chunk_used_ = 0;
  }
  return copy_into_chunk(frame, context);
}

void KeptMessage::begin_copy(std::uint32_t bytes, EgressContext& context) {
  first_ = Run{};
  more_.clear();
  chunk_used_ = frames_ = 0;
  bytes_ = 0;
  // acquire pairs with the release in BufferPool::end_loan(): no other shard reads it any more.
  const bool own =
      chunk_ && chunk_->references == 1 && chunk_->lent.load(std::memory_order_acquire) == 0;
  const bool large = chunk_ && chunk_->capacity > kOwnRoomBytes;
  const bool fits = own && bytes <= chunk_->capacity &&
                    (!large || chunk_->capacity - bytes <= chunk_->capacity / 8);
  if (!fits) chunk_ = context.pool.take_exact(bytes);
}

std::byte* KeptMessage::append_copy(const Run& frame, EgressContext& context) {
  if (chunk_->capacity - chunk_used_ < frame.size) {
    chunk_ = context.pool.take_exact(std::max(frame.size, kCopyBytesMax));
    chunk_used_ = 0;
  }
  std::byte* const place = chunk_->data + chunk_used_;
  add(copy_into_chunk(frame, context));
  return place;
}

/// REQUIRES: there is room.
Run KeptMessage::copy_into_chunk(const Run& frame, EgressContext& context) {
  std::byte* place = chunk_->data + chunk_used_;
  std::memcpy(place, frame.bytes, frame.size);
  chunk_used_ += frame.size;
  context.tally.copied_bytes += frame.size;
  return Run{chunk_.share(), place, frame.size, frame.frames};
}

void KeptMessage::clear() {
  first_ = Run{};
  more_.clear();
  chunk_.reset();
  chunk_used_ = frames_ = 0;
  bytes_ = 0;
}

}  // namespace gimnet::hub
