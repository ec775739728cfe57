#include "hub/data/egress/outbox.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "hub/data/egress/resume_buffer.hpp"
#include "proto/frame/frame_parser.hpp"

namespace gimnet::hub {
namespace {
constexpr std::uint32_t kFirstChunkBytes = 256;
constexpr std::uint32_t kChunkGrowth = 4;  // from one size of the pool to the next
constexpr std::uint32_t kChunkBytesMax = 16 * 1024;
}  // namespace

std::uint64_t Outbox::lane_limit(std::size_t lane, const Limits& limits) {
  const std::uint64_t by_lane[] = {limits.lane0_bytes, limits.lane1_bytes, limits.lane2_bytes, limits.lane3_bytes};
  return by_lane[lane];
}

std::uint64_t Outbox::data_bytes() const {
  std::uint64_t bytes = 0;
  for (const LaneQueue& lane : lanes_) bytes += lane.bytes();
  return bytes;
}

std::uint64_t Outbox::waiting_bytes() const {
  std::uint64_t bytes = control_bytes_ + data_bytes();
  if (!replay_.empty()) bytes += 1;  // how many does not matter: they were counted as waiting all along
  return bytes;
}

std::uint64_t Outbox::stale_bytes() const {
  std::uint64_t bytes = replay_.empty() ? 0 : 1;
  for (const LaneQueue& lane : lanes_) bytes += lane.bytes() - lane.latest_bytes();
  return bytes;
}

bool Outbox::has_block() const {
  return std::any_of(lanes_.begin(), lanes_.end(), [](const LaneQueue& lane) { return lane.block_bytes() != 0; });
}

bool Outbox::fits(std::size_t lane, std::uint32_t bytes, const Limits& limits) const {
  return lanes_[lane].bytes() + bytes <= lane_limit(lane, limits);
}

Run Outbox::copy(const Run& run, EgressContext& context) {
  if (!chunk_ || chunk_->capacity - chunk_used_ < run.size) {
    // A large one saves entries and calls where there is room; where there is none, each outbox takes what it must.
    chunk_bytes_ = context.budget.exhausted() ? 0 : std::clamp(kChunkGrowth * chunk_bytes_, kFirstChunkBytes, kChunkBytesMax);
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

Entry Outbox::make_entry(const Run& run, const proto::FrameHeader& header, Handover handover, EgressContext& context) {
  Entry entry;
  entry.extended = header.has(proto::kFlagExt);
  // An extension may be a TRACE, which each recipient gets filled in on its own.
  const bool by_copy = (run.size < kCopyBytesMax && !handover.fan_out) || entry.extended;
  entry.run = by_copy ? copy(run, context) : run.share();
  entry.size = run.size;
  entry.frames = run.frames;
  entry.block = is_block(header);
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

void Outbox::push(const Run& run, const proto::FrameHeader& header, Handover handover, EgressContext& context) {
  const std::size_t lane = header.lane & proto::kLaneMask;
  context.tally.queued += run.frames;
  if (!backlog_ && !handover.fan_out && append_copy(run, header, context)) return;
  Entry entry = make_entry(run, header, handover, context);
  if (entry.fragmented) {
    if (entry.touched && join_message(entry, header, context)) return;
    // The beginning of a message: a number that was cut before is in use again.
    if (!entry.touched && !cut_.empty()) forget_cut(NodeId{header.src}, entry.message_number);
  }
  if (!backlog_ && fits(lane, run.size, context.limits)) {
    lanes_[lane].push(std::move(entry));
    return;
  }
  admit(std::move(entry), header, context);
}

/// The usual case of small messages, made short: more of what came last, copied right behind it.
bool Outbox::append_copy(const Run& run, const proto::FrameHeader& header, EgressContext& context) {
  if (run.size >= kCopyBytesMax || !chunk_ || chunk_->capacity - chunk_used_ < run.size) return false;
  const std::size_t lane = header.lane & proto::kLaneMask;
  if (!proto::may_form_run(header) || !fits(lane, run.size, context.limits)) return false;
  std::byte* place = chunk_->data + chunk_used_;
  if (!lanes_[lane].extend_last(run, *chunk_.get(), place)) return false;
  std::memcpy(place, run.bytes, run.size);
  chunk_used_ += run.size;
  context.tally.copied_bytes += run.size;
  return true;
}

bool Outbox::push_control(std::span<const std::byte> frame, EgressContext& context) {
  if (control_bytes_ + frame.size() > context.limits.control_bytes) return false;
  Run run{BufferRef{}, frame.data(), static_cast<std::uint32_t>(frame.size()), 1};
  Run copied = copy(run, context);
  context.tally.copied_bytes -= run.size;  // that counter is about data
  control_bytes_ += run.size;
  if (control_.empty() || !control_.back().extend(copied)) control_.push_back(std::move(copied));
  return true;
}

bool Outbox::join_message(Entry& entry, const proto::FrameHeader& header, EgressContext& context) {
  if (is_cut(entry, header, context)) return true;
  Entry* message = lanes_[header.lane & proto::kLaneMask].find_message(NodeId{header.src}, entry.message_number);
  if (message == nullptr) return false;
  if (backlog_ && context.budget.exhausted()) {
    lose(entry, proto::DropReason::over_budget, context);
    return true;
  }
  const bool over = !fits(header.lane & proto::kLaneMask, entry.size, context.limits);
  if (over && entry.block) {
    ask_to_pause(entry, header, context);
  }
  // The message may have been settled already, and is not looked at again.
  if (backlog_) settle_run(entry.run, entry.shared, context);
  lanes_[header.lane & proto::kLaneMask].append_fragment(*message, std::move(entry.run), entry.complete,
                                                         context.pieces);
  return true;
}

void Outbox::forget_cut(NodeId src, std::uint32_t number) {
  std::erase_if(cut_, [&](const CutMessage& each) { return each.src == src && each.number == number; });
}

bool Outbox::is_cut(const Entry& entry, const proto::FrameHeader& header, EgressContext& context) {
  const NodeId src{header.src};
  const auto cut = std::find_if(cut_.begin(), cut_.end(), [&](const CutMessage& each) {
    return each.src == src && each.number == entry.message_number;
  });
  if (cut == cut_.end()) return false;
  if (entry.complete) cut_.erase(cut);
  tell_lost(entry);
  context.tally.queued -= entry.frames;
  context.drops.drop(entry.run.bytes, entry.run.size, entry.run.frames, proto::DropReason::cut_message);
  return true;
}

void Outbox::admit(Entry entry, const proto::FrameHeader& header, EgressContext& context) {
  LaneQueue& lane = lanes_[header.lane & proto::kLaneMask];
  if (entry.latest && !entry.touched) {
    Entry older;
    // It takes a place that may have been settled already, and is not looked at again.
    if (backlog_) settle_run(entry.run, entry.shared, context);
    if (lane.replace_latest(entry, older)) {
      lose(older, proto::DropReason::replaced, context);
      return;
    }
  }
  if (context.budget.exhausted()) {
    lose(entry, proto::DropReason::over_budget, context);
  } else if (entry.touched || fits(header.lane & proto::kLaneMask, entry.size, context.limits)) {
    lane.push(std::move(entry));
  } else if (entry.block) {
    admit_block(std::move(entry), header, context);
  } else {
    admit_full(std::move(entry), header, context);
  }
}

void Outbox::admit_block(Entry entry, const proto::FrameHeader& header, EgressContext& context) {
  ask_to_pause(entry, header, context);
  const std::size_t lane = header.lane & proto::kLaneMask;
  const std::uint64_t most = lane_limit(lane, context.limits) + kReservesMax * context.limits.reserve_bytes;
  if (lanes_[lane].bytes() + entry.size > most) {
    lose(entry, proto::DropReason::queue_full, context);
  } else {
    lanes_[lane].push(std::move(entry));
  }
}

void Outbox::ask_to_pause(const Entry& entry, const proto::FrameHeader& header, EgressContext& context) {
  const std::size_t lane = header.lane & proto::kLaneMask;
  const bool past_reserve =
      lanes_[lane].bytes() + entry.size > lane_limit(lane, context.limits) + context.limits.reserve_bytes;
  pauses_.on_full(NodeId{header.src}, {header.kind, static_cast<proto::Lane>(lane), header.dst}, entry.size,
                  past_reserve, context.signals);
}

/// Policies count messages: the first ones of a run may still fit.
void Outbox::admit_full(Entry entry, const proto::FrameHeader& header, EgressContext& context) {
  while (entry.run.frames > 1) {
    Entry first;
    first.run = entry.run.share();
    first.run.size = first.size = entry.run.skip_frame();
    first.run.frames = first.frames = 1;
    first.shared = entry.shared;
    entry.size -= first.size;
    --entry.frames;
    admit_message(std::move(first), header, context);
  }
  admit_message(std::move(entry), header, context);
}

void Outbox::admit_message(Entry entry, const proto::FrameHeader& header, EgressContext& context) {
  const std::size_t index = header.lane & proto::kLaneMask;
  LaneQueue& lane = lanes_[index];
  if (header.policy() != proto::Policy::drop) {
    Entry oldest;
    while (!fits(index, entry.size, context.limits) && lane.drop_oldest(oldest)) {
      lose(oldest, proto::DropReason::queue_full, context);
    }
  }
  // A message that is larger than the limit may wait as long as it is the only one.
  if (fits(index, entry.size, context.limits) || (lane.bytes() == 0 && header.policy() != proto::Policy::drop)) {
    lane.push(std::move(entry));
  } else {
    lose(entry, proto::DropReason::queue_full, context);
  }
}

void Outbox::lose(Entry& entry, proto::DropReason reason, EgressContext& context) {
  if (entry.frames == 0) return;
  if (entry.fragmented && !entry.complete) {
    if (cut_.size() == kCutMessagesMax) cut_.erase(cut_.begin());
    cut_.push_back({NodeId{entry.run.header().src}, entry.message_number});
  }
  tell_lost(entry);
  context.tally.queued -= entry.frames;
  do {
    if (entry.run.frames != 0) context.drops.drop(entry.run.bytes, entry.run.size, entry.run.frames, reason);
  } while (entry.next_piece());
  entry.size = entry.frames = 0;
}

void Outbox::settle(EgressContext& context) {
  backlog_ = true;
  charge_entries(context);
  for (std::size_t lane = 0; lane < lanes_.size(); ++lane) settle_lane(lanes_[lane], settled_[lane], context);
}

void Outbox::charge_entries(EgressContext& context) {
  std::uint64_t bytes = 0;
  for (const LaneQueue& lane : lanes_) bytes += lane.capacity_bytes();
  // A ring doubles into new memory; the allocator keeps the old one for a while (tests/stress/budget_test.cpp).
  bytes += bytes / 2;
  if (bytes > charged_bytes_) context.budget.take(bytes - charged_bytes_);
  if (bytes < charged_bytes_) context.budget.give_back(charged_bytes_ - bytes);
  charged_bytes_ = bytes;
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
  if (run.size < kSettleBytesMax && !shared && run.buffer->kind != BufferKind::chunk) run = copy(run, context);
  context.pool.pin(*run.buffer.get());
}

void Outbox::on_emptied(EgressContext& context) {
  context.budget.give_back(std::exchange(charged_bytes_, 0));
  backlog_ = false;
  owed_ = {};
  chunk_.reset();
  chunk_bytes_ /= kChunkGrowth;
}

void Outbox::signal_room(EgressContext& context) {
  if (pauses_.empty()) return;
  for (std::size_t lane = 0; lane < lanes_.size(); ++lane) {
    if (lanes_[lane].bytes() <= lane_limit(lane, context.limits) / 2) {
      pauses_.on_room(static_cast<proto::Lane>(lane), context.signals);
    }
  }
}

void Outbox::time_out_block(EgressContext& context) {
  for (LaneQueue& lane : lanes_) {
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
  drop_replay(reason, context);
  for (LaneQueue& lane : lanes_) {
    while (!lane.empty()) {
      Entry& entry = lane.entries().front();
      lane.on_left(entry, entry.size);
      lose(entry, reason, context);
      lane.pop_front();
    }
  }
  clear_control();
  cut_.clear();
  pauses_.release_all(context.signals);
  on_emptied(context);
}

void Outbox::drop_replay(proto::DropReason reason, EgressContext& context) {
  for (; !replay_.empty(); replay_.pop_front()) {
    const Run& run = replay_.front();
    tell_lost(run);
    context.tally.queued -= run.frames;
    context.drops.drop_mixed(run.bytes, run.size, reason);
  }
}

void Outbox::tell_lost(const Entry& entry) const {
  if (counted_ == nullptr) return;
  const proto::FrameHeader header = entry.run.header();
  if (header.kind != proto::Kind::group) return;
  counted_->on_lost(GroupId{header.dst}, entry.fragmented ? (entry.complete ? 1 : 0) : entry.frames);
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
  std::uint64_t messages = 0;
  for (LaneQueue& lane : lanes_) {
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
  replay_.trim();
  for (LaneQueue& lane : lanes_) lane.trim();
}

void Outbox::clear_control() {
  control_.clear();
  control_bytes_ = 0;
}

}  // namespace gimnet::hub
