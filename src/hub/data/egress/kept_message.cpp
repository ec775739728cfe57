#include "hub/data/egress/kept_message.hpp"

#include <cstring>

namespace gimnet::hub {

void KeptMessage::append(const Run& frame, bool shared, EgressContext& context) {
  const bool small = frame.size < kCopyBytesMax && !shared;
  const bool by_copy =
      (small || context.budget.scarce()) && frame.buffer->kind != BufferKind::chunk;
  Run piece = by_copy ? copy(frame, context) : frame.share();
  context.pool.pin(*piece.buffer.get());
  frames_ += piece.frames;
  bytes_ += piece.size;
  Run& last = more_.empty() ? first_ : more_.back();
  if (first_.frames == 0) {
    first_ = std::move(piece);
  } else if (!last.extend(piece)) {
    more_.push_back(std::move(piece));
  }
}

Run KeptMessage::copy(const Run& frame, EgressContext& context) {
  if (!chunk_ || chunk_->capacity - chunk_used_ < frame.size) {
    // The frames of a large message share chunks; a small message takes what it needs.
    const bool exact = context.budget.scarce() && frame.size >= BufferPool::kExactBytesMin;
    chunk_ = exact ? context.pool.take_exact(frame.size)
                   : context.pool.take_chunk(frames_ == 0 ? frame.size : kCopyBytesMax);
    chunk_used_ = 0;
  }
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
