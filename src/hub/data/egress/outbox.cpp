#include "hub/data/egress/outbox.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "proto/frame/frame_parser.hpp"

namespace gimnet::hub {
namespace {
constexpr std::uint32_t kFirstChunkBytes = 256 - kBufferRoom;
constexpr std::uint32_t kChunkGrowth = 4;  // from one size of the pool to the next
}  // namespace

std::uint64_t Outbox::data_bytes() const {
  if (!lanes_) return 0;
  std::uint64_t bytes = 0;
  for (const LaneQueue& queue : lanes_->queues) bytes += queue.bytes();
  return bytes;
}

std::uint64_t Outbox::waiting_bytes() const {
  std::uint64_t bytes = control_bytes_ + data_bytes();
  if (lanes_ && !lanes_->replay.empty())
    bytes += 1;  // how many does not matter: they were counted as waiting all along
  return bytes;
}

std::uint64_t Outbox::stale_bytes() const {
  if (!lanes_) return 0;
  std::uint64_t bytes = lanes_->replay.empty() ? 0 : 1;
  for (const LaneQueue& queue : lanes_->queues) bytes += queue.bytes() - queue.latest_bytes();
  return bytes;
}

bool Outbox::has_block() const {
  return lanes_ && std::ranges::any_of(lanes_->queues, [](const LaneQueue& each) {
           return each.block_bytes() != 0;
         });
}

std::uint64_t Outbox::room(std::size_t lane, bool block, const Limits& limits) const {
  const LaneQueue& queue = lanes_->queues[lane];
  const std::uint64_t half = limits.lane_bytes(lane) / 2;
  if (block) return half - std::min(half, queue.block_bytes());
  const std::uint64_t share = limits.lane_bytes(lane) - std::min(half, queue.block_bytes());
  return share - std::min(share, queue.bytes() - queue.block_bytes());
}

std::uint64_t Outbox::held_bytes() const {
  std::uint64_t bytes = control_bytes_ + paced_bytes_;
  if (resume_ != nullptr) bytes += resume_->bytes();
  if (!lanes_) return bytes;
  for (const LaneQueue& queue : lanes_->queues) bytes += queue.held_bytes();
  return bytes + lanes_->replay_bytes;
}

void Outbox::note_waiting(EgressContext& context) {
  const bool waits = held_bytes() != 0;
  if (waits == waits_) return;
  waits_ = waits;
  if (waits) {
    context.budget.begin_waiting();
  } else {
    context.budget.end_waiting();
  }
}

Run Outbox::copy_alone(const Run& run, EgressContext& context) {
  BufferRef chunk = context.pool.take_exact(run.size);
  std::memcpy(chunk->data, run.bytes, run.size);
  context.tally.copied_bytes += run.size;
  const std::byte* const bytes = chunk->data;
  return Run{std::move(chunk), bytes, run.size, run.frames};
}

Run Outbox::copy(const Run& run, EgressContext& context) {
  if (context.budget.scarce() && run.size >= BufferPool::kExactBytesMin)
    return copy_alone(run, context);
  close_run();
  if (!chunk_ || chunk_->capacity - chunk_used_ < run.size) {
    // A large one saves entries and calls where there is room; where there is little, each outbox
    // takes what it must.
    const bool little = context.budget.scarce() || context.budget.exhausted();
    chunk_bytes_ =
        little ? 0 : std::clamp(kChunkGrowth * chunk_bytes_, kFirstChunkBytes, kSharedChunkBytes);
    chunk_ = context.pool.take_chunk(std::max(run.size, chunk_bytes_));
    chunk_used_ = 0;
    // At once where something waits: by the end of the turn many outboxes may have begun one.
    if (backlog_) context.pool.pin(*chunk_.get());
  }
  std::byte* place = chunk_->data + chunk_used_;
  std::memcpy(place, run.bytes, run.size);
  chunk_used_ += run.size;
  context.tally.copied_bytes += run.size;
  return Run{chunk_.share(), place, run.size, run.frames};
}

Entry Outbox::make_entry(const Run& run, const proto::FrameHeader& header, Handover handover,
                         bool has_room, EgressContext& context) {
  Entry entry;
  entry.extended = header.has(proto::kFlagExt);
  // Frames that will probably be refused are not copied: they would fill a chunk that others keep.
  // Those that stay are copied at the turn's end. An extension may be a TRACE, which each recipient
  // gets filled in on its own.
  const bool by_copy =
      (run.size < kAppendBytesMax && !handover.fan_out && has_room) || entry.extended;
  entry.run = by_copy ? copy(run, context) : run.share();
  entry.size = run.size;
  entry.frames = run.frames;
  entry.block = proto::is_block(header);
  entry.latest = header.policy() == proto::Policy::latest;
  entry.shared = handover.fan_out;
  if (header.has(proto::kFlagFragment)) {
    const auto frame = proto::parse_frame({entry.run.bytes, entry.run.size}, proto::Origin::hub);
    if (frame && frame->fragment) {
      entry.fragmented = true;
      entry.message_number = frame->fragment->message;
      entry.touched = frame->fragment->offset != 0;  // unless its beginning still waits
      entry.complete = frame->fragment->offset + frame->payload.size() == frame->fragment->total;
    }
  }
  return entry;
}

void Outbox::push(const Run& run, const proto::FrameHeader& header, Handover handover,
                  EgressContext& context) {
  context.owner.check_here();
  const std::size_t lane = header.lane & proto::kLaneMask;
  context.tally.queued += run.frames;
  if (!handover.fan_out && append(run.bytes, run.size, run.frames)) {
    context.tally.copied_bytes += run.size;
    return;
  }
  Lanes& lanes = this->lanes();
  lanes.open.close();
  const bool by_share = backlog_ && context.budget.scarce();
  if (by_share && run.frames > 1 && run.size > kSharedChunkBytes) {
    context.tally.queued -= run.frames;
    return push_in_pieces(run, header, handover, context);
  }
  const bool has_room = surely_fits(lanes.queues[lane].bytes() + run.size, lane, context.limits) ||
                        run.size <= room(lane, proto::is_block(header), context.limits);
  Entry entry = make_entry(run, header, handover, has_room && !by_share, context);
  if (by_share) make_share(entry, header, context);
  if (entry.fragmented) {
    if (!follow_message(entry, context)) return;
    if (entry.touched && join_message(entry, header, context)) return;
  }
  if (!backlog_ && has_room) {
    const bool may_grow = proto::may_form_run(header) && entry.run.buffer.get() == chunk_.get();
    lanes.queues[lane].push(std::move(entry));
    if (may_grow) open_run(lanes.queues[lane], context.limits, lane);
    return;
  }
  admit(std::move(entry), header, context);
}

void Outbox::open_run(LaneQueue& lane, const Limits& limits, std::size_t lane_index) {
  Entry& last = lane.entries().back();
  std::uint32_t open_room = chunk_->capacity - chunk_used_;
  if (!surely_fits(lane.bytes() + open_room, lane_index, limits)) {
    open_room = static_cast<std::uint32_t>(
        std::min<std::uint64_t>(open_room, room(lane_index, last.block, limits)));
  }
  lanes_->open = {open_room,
                  load_le<std::uint32_t>(last.run.bytes + proto::kAttributesOffset),
                  load_le<std::uint64_t>(last.run.bytes + proto::kAddressesOffset),
                  chunk_->data + chunk_used_,
                  &lane,
                  &last};
}

bool Outbox::push_control(std::span<const std::byte> frame, EgressContext& context,
                          std::uint64_t bytes_most) {
  context.owner.check_here();
  if (control_bytes_ - first_control_bytes() + frame.size() > bytes_most) return false;
  put_control(frame, context);
  return true;
}

void Outbox::push_first_control(std::span<const std::byte> frames, EgressContext& context) {
  context.owner.check_here();
  while (!frames.empty()) {
    const std::size_t size = proto::load_header(frames.data()).frame_size();
    put_control(frames.first(size), context);
    lanes().first_control_bytes += static_cast<std::uint32_t>(size);
    frames = frames.subspan(size);
  }
}

void Outbox::put_control(std::span<const std::byte> frame, EgressContext& context) {
  Run run{BufferRef{}, frame.data(), static_cast<std::uint32_t>(frame.size()), 1};
  Run copied = copy(run, context);
  context.tally.copied_bytes -= run.size;  // that counter is about data
  control_bytes_ += run.size;
  if (control_.empty() || !control_.back().extend(copied)) control_.push_back(std::move(copied));
}

void Outbox::settle(EgressContext& context) {
  const bool begins = !std::exchange(backlog_, true);
  // Once it waits it does so until it is emptied.
  if (!waits_) note_waiting(context);
  if (!lanes_) return;
  lanes_->open.close();
  if (begins) replace_latest(context);
  charge_entries(context);
  for (std::size_t lane = 0; lane < proto::kLaneCount; ++lane) {
    settle_lane(lanes_->queues[lane], lanes_->settled[lane], context);
  }
}

/// While nothing waited, nobody asked whether an older message of the stream does.
void Outbox::replace_latest(EgressContext& context) {
  for (LaneQueue& lane : lanes_->queues) {
    if (lane.latest_bytes() == 0) continue;
    lane.replace_all_latest(
        [&](Entry& older) { lose(older, proto::DropReason::replaced, context); });
  }
}

void Outbox::charge_entries(EgressContext& context) {
  std::uint64_t bytes = 0;
  for (const LaneQueue& queue : lanes_->queues) bytes += queue.capacity_bytes();
  // A ring doubles into new memory; the allocator keeps the old one for a while
  // (tests/stress/budget_test.cpp).
  bytes += bytes / 2;
  std::uint64_t& charged = lanes_->charged_bytes;
  if (bytes > charged) context.budget.take(bytes - charged);
  if (bytes < charged) context.budget.give_back(charged - bytes);
  charged = bytes;
}

void Outbox::settle_lane(LaneQueue& lane, std::uint64_t& settled, EgressContext& context) {
  RingQueue<Entry>& entries = lane.entries();
  settled = std::max(settled, entries.first_number());
  for (; settled < entries.end_number(); ++settled) {
    Entry& entry = entries.at(settled);
    if (entry.frames != 0) {
      settle_run(entry.run, entry.shared, context);
      for (MorePieces* more = entry.more.get(); more != nullptr; more = more->next.get()) {
        settle_run(more->run, entry.shared, context);
      }
    }
    // The last entry may grow until the next turn: it is looked at again then.
    if (settled + 1 == entries.end_number()) break;
  }
}

void Outbox::settle_run(Run& run, bool shared, EgressContext& context) {
  const bool by_copy = (run.size < kSettleBytesMax && !shared) || context.budget.scarce();
  if (by_copy && run.buffer->kind != BufferKind::chunk) run = copy(run, context);
  context.pool.pin(*run.buffer.get());
}

void Outbox::on_emptied(EgressContext& context) {
  if (lanes_) {
    context.budget.give_back(std::exchange(lanes_->charged_bytes, 0));
    lanes_->owed = {};
    lanes_->open.close();
  }
  backlog_ = false;
  const bool waits = paced_bytes_ != 0 || (resume_ != nullptr && resume_->bytes() != 0);
  if (waits != waits_) note_waiting(context);
  chunk_.reset();
  chunk_bytes_ /= kChunkGrowth;
}

void Outbox::signal_room(EgressContext& context) {
  if (!paused_anyone()) return;
  if (context.budget.scarce() && data_bytes() > context.budget.share_bytes() / 2) return;
  for (std::size_t lane = 0; lane < proto::kLaneCount; ++lane) {
    if (lanes_->queues[lane].block_bytes() <= context.limits.lane_bytes(lane) / 4) {
      lanes_->pauses.on_room(static_cast<proto::Lane>(lane), context.signals);
    }
  }
}

void Outbox::time_out_block(EgressContext& context) {
  close_run();
  if (!lanes_) return;
  for (LaneQueue& lane : lanes_->queues) {
    RingQueue<Entry>& entries = lane.entries();
    for (std::uint64_t number = entries.first_number(); number != entries.end_number(); ++number) {
      Entry& entry = entries.at(number);
      if (entry.frames == 0 || !entry.block || entry.touched) continue;
      lane.on_left(entry, entry.size);
      lose(entry, proto::DropReason::timed_out, context);
    }
    while (!entries.empty() && entries.front().frames == 0) lane.pop_front();
  }
  signal_room(context);
}

void Outbox::drop_all(proto::DropReason reason, EgressContext& context) {
  clear_control();
  if (lanes_) {
    drop_replay(reason, context);
    for (LaneQueue& lane : lanes_->queues) {
      while (!lane.empty()) {
        Entry& entry = lane.entries().front();
        lane.on_left(entry, entry.size);
        lose(entry, reason, context);
        lane.pop_front();
      }
    }
    lanes_->open_messages.clear();
    lanes_->pauses.release_all(context.signals);
  }
  on_emptied(context);
}

void Outbox::set_replay(RingQueue<Run> frames) {
  Lanes& lanes = this->lanes();
  lanes.replay = std::move(frames);
  lanes.replay_bytes = 0;
  RingQueue<Run>& replay = lanes.replay;
  for (std::uint64_t number = replay.first_number(); number != replay.end_number(); ++number)
    lanes.replay_bytes += replay.at(number).size;
}

void Outbox::drop_replay(proto::DropReason reason, EgressContext& context) {
  if (!lanes_) return;
  lanes_->replay_bytes = 0;
  for (RingQueue<Run>& replay = lanes_->replay; !replay.empty(); replay.pop_front()) {
    const Run& run = replay.front();
    tell_lost(run);
    count_dropped(run.frames);
    context.tally.queued -= run.frames;
    context.drops.drop_mixed(run.bytes, run.size, reason);
  }
}

void Outbox::tell_lost(const Entry& entry) const {
  if (counted_ == nullptr) return;
  const proto::FrameHeader header = entry.run.header();
  if (header.kind != proto::Kind::group) return;
  counted_->on_lost(GroupId{header.dst},
                    entry.fragmented ? (entry.complete ? 1 : 0) : entry.frames);
}

void Outbox::tell_lost(const Run& run, const proto::FrameHeader& header) const {
  if (counted_ == nullptr || header.kind != proto::Kind::group) return;
  if (header.has(proto::kFlagFragment)) return tell_lost(run);
  counted_->on_lost(GroupId{header.dst}, run.frames);
}

void Outbox::tell_lost(const Run& run) const {
  if (counted_ == nullptr) return;
  for (Run rest = run.share(); rest.frames != 0; rest.skip_frame()) {
    const proto::FrameHeader header = rest.header();
    if (header.kind != proto::Kind::group) continue;
    const auto frame = proto::parse_frame({rest.bytes, rest.size}, proto::Origin::hub);
    if (frame && frame->ends_message()) counted_->on_lost(GroupId{header.dst}, 1);
  }
}

std::uint64_t Outbox::waiting_messages(GroupId group) {
  if (!lanes_) return 0;
  std::uint64_t messages = 0;
  for (LaneQueue& lane : lanes_->queues) {
    RingQueue<Entry>& entries = lane.entries();
    for (std::uint64_t number = entries.first_number(); number != entries.end_number(); ++number) {
      const Entry& entry = entries.at(number);
      if (entry.frames == 0) continue;
      const proto::FrameHeader header = entry.run.header();
      if (header.kind != proto::Kind::group || header.dst != group.value()) continue;
      messages += entry.fragmented ? (entry.complete ? 1 : 0) : entry.frames;
    }
  }
  return messages;
}

void Outbox::trim() {
  control_.trim();
  if (!lanes_) return;
  const bool idle = std::ranges::all_of(lanes_->queues, &LaneQueue::empty) &&
                    lanes_->replay.empty() && lanes_->pauses.empty() &&
                    lanes_->open_messages.empty() && lanes_->first_control_bytes == 0 &&
                    !backlog_ && !has_untold_losses_;
  if (idle) return lanes_.reset();
  lanes_->replay.trim();
  for (LaneQueue& queue : lanes_->queues) queue.trim();
}

void Outbox::clear_control() {
  control_.clear();
  control_bytes_ = 0;
  if (lanes_) lanes_->first_control_bytes = 0;
}

}  // namespace gimnet::hub
