#include "hub/data/egress/copy_chunk.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

namespace gimnet::hub {
namespace {

Run copy_alone(const Run& run, EgressContext& context) {
  BufferRef chunk = context.pool.take_exact(run.size);
  std::memcpy(chunk->data, run.bytes, run.size);
  context.tally.copied_bytes += run.size;
  const std::byte* const bytes = chunk->data;
  return Run{std::move(chunk), bytes, run.size, run.frames};
}

}  // namespace

void OpenRun::open(LaneQueue& of, const CopyChunk& chunk, std::uint64_t bytes_max) {
  Entry& last = of.entries().back();
  room = chunk.room();
  if (!of.surely_fits(room, bytes_max)) {
    room =
        static_cast<std::uint32_t>(std::min<std::uint64_t>(room, of.room(last.block, bytes_max)));
  }
  attributes = load_le<std::uint32_t>(last.run.bytes + proto::kAttributesOffset);
  addresses = load_le<std::uint64_t>(last.run.bytes + proto::kAddressesOffset);
  end = chunk.end();
  lane = &of;
  entry = &last;
}

Run CopyChunk::copy(const Run& run, bool waits, BudgetLease& budget, EgressContext& context) {
  if (run.size >= BufferPool::kExactBytesMin && budget.scarce()) return copy_alone(run, context);
  if (!chunk_ || chunk_->capacity - used_ < run.size) {
    // A large one saves entries and calls where there is room; where there is little, each outbox
    // takes what it must.
    const bool little = budget.scarce() || budget.exhausted();
    next_bytes_ = little ? 0 : std::clamp(kGrowth * next_bytes_, kFirstBytes, kSharedChunkBytes);
    chunk_ = context.pool.take_chunk(std::max(run.size, next_bytes_));
    used_ = 0;
    // At once where something waits: by the end of the turn many outboxes may have begun one.
    if (waits) context.pool.pin(*chunk_.get(), budget);
  }
  std::byte* place = chunk_->data + used_;
  std::memcpy(place, run.bytes, run.size);
  used_ += run.size;
  context.tally.copied_bytes += run.size;
  return Run{chunk_.share(), place, run.size, run.frames};
}

}  // namespace gimnet::hub
