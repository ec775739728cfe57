#include "hub/data/egress/outbox.hpp"

#include <algorithm>
#include <utility>

#include "proto/frame/frame_parser.hpp"

namespace gimnet::hub {

std::uint64_t Outbox::waiting_bytes() const {
  std::uint64_t bytes = control_.bytes() + data_bytes();
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

std::uint64_t Outbox::held_bytes() const {
  std::uint64_t bytes = control_.bytes() + paced_bytes_;
  if (resume_ != nullptr) bytes += resume_->bytes();
  if (!lanes_) return bytes;
  for (const LaneQueue& queue : lanes_->queues) bytes += queue.held_bytes();
  return bytes + lanes_->replay.bytes();
}

void Outbox::note_waiting(EgressContext& context) {
  const bool waits = held_bytes() != 0;
  if (waits == waits_) return;
  waits_ = waits;
  waits ? budget(context).begin_waiting() : budget(context).end_waiting();
}

Run Outbox::copy(const Run& run, EgressContext& context) {
  close_run();
  return chunk_.copy(run, backlog_, budget(context), context);
}

Entry Outbox::make_entry(const Run& run, const proto::FrameHeader& header, Handover handover,
                         bool has_room, EgressContext& context) {
  // Frames that will probably be refused are not copied: they would fill a chunk that others keep.
  // Those that stay are copied at the turn's end. An extension may be a TRACE, which each recipient
  // gets filled in on its own.
  const bool by_copy =
      (run.size < kAppendBytesMax && !handover.fan_out && has_room) || header.has(proto::kFlagExt);
  return Entry::of(by_copy ? copy(run, context) : run.share(), header, handover.fan_out);
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
  const bool by_share = backlog_ && budget(context).scarce();
  if (by_share && run.frames > 1 && run.size > kSharedChunkBytes) {
    context.tally.queued -= run.frames;
    return push_in_pieces(run, header, handover, context);
  }
  // While nothing waits, a link's lane is as a node's.
  const bool as_of_a_node = !(backlog_ && link_);
  const bool has_room =
      (as_of_a_node && lanes.queues[lane].surely_fits(run.size, context.limits.lane_bytes(lane))) ||
      run.size <= room(lane, proto::is_block(header), context.limits);
  Entry entry = make_entry(run, header, handover, has_room && !by_share, context);
  if (by_share) make_share(entry, header, context);
  if (entry.fragmented) {
    if (!lanes.open_messages.follow(entry))
      return lose(entry, proto::DropReason::cut_message, context);
    if (entry.touched && join_message(entry, header, context)) return;
  }
  if (!backlog_ && has_room) {
    const bool may_grow = proto::may_form_run(header) && chunk_.holds(entry.run);
    lanes.queues[lane].push(std::move(entry));
    if (may_grow) lanes.open.open(lanes.queues[lane], chunk_, context.limits.lane_bytes(lane));
    return;
  }
  admit(std::move(entry), header, context);
}

bool Outbox::push_control(std::span<const std::byte> frame, EgressContext& context,
                          std::uint64_t bytes_most) {
  context.owner.check_here();
  if (control_.counted_bytes() + frame.size() > bytes_most) return false;
  control_.push(copy_control(frame, context));
  return true;
}

void Outbox::push_first_control(std::span<const std::byte> frames, EgressContext& context) {
  context.owner.check_here();
  while (!frames.empty()) {
    const std::size_t size = proto::load_header(frames.data()).frame_size();
    control_.push_uncounted(copy_control(frames.first(size), context));
    frames = frames.subspan(size);
  }
}

Run Outbox::copy_control(std::span<const std::byte> frame, EgressContext& context) {
  context.tally.copied_bytes -= frame.size();  // that counter is about data
  const auto size = static_cast<std::uint32_t>(frame.size());
  return copy(Run{BufferRef{}, frame.data(), size, 1}, context);
}

void Outbox::settle(EgressContext& context) {
  if (!waits_here()) waiting_since_ms_ = context.now_ms;
  const bool begins = !std::exchange(backlog_, true);
  // Once it waits it does so until it is emptied.
  if (!waits_) note_waiting(context);
  if (!lanes_) return;
  lanes_->open.close();
  if (begins) replace_latest(context);
  budget(context).change(lanes_->charged_bytes, entry_bytes());
  for (LaneQueue& lane : lanes_->queues) {
    lane.settle([&](Entry& entry) {
      settle_run(entry.run, entry.shared, context);
      for (MorePieces* more = entry.more.get(); more != nullptr; more = more->next.get())
        settle_run(more->run, entry.shared, context);
    });
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

std::uint64_t Outbox::entry_bytes() const {
  std::uint64_t bytes = 0;
  for (const LaneQueue& queue : lanes_->queues) bytes += queue.capacity_bytes();
  // A ring doubles into new memory; the allocator keeps the old one for a while
  // (tests/stress/budget_test.cpp).
  return bytes + bytes / 2;
}

void Outbox::settle_run(Run& run, bool shared, EgressContext& context) {
  BudgetLease& own = budget(context);
  const bool small = run.size < kSettleBytesMax && !shared;
  // While nothing waits, a frame is kept until it is confirmed, which is soon: whoever pays for its
  // buffer, it stays there.
  const bool by_copy = backlog_ ? must_copy(*run.buffer.get(), small, own)
                                : (small || own.scarce()) && run.buffer->kind != BufferKind::chunk;
  if (by_copy) run = copy(run, context);
  context.pool.pin(*run.buffer.get(), own);
}

void Outbox::on_emptied(EgressContext& context) {
  if (lanes_) {
    if (lanes_->charged_bytes != 0)
      budget(context).give_back(std::exchange(lanes_->charged_bytes, 0));
    lanes_->owed = {};
    lanes_->open.close();
  }
  backlog_ = false;
  const bool waits = paced_bytes_ != 0 || (resume_ != nullptr && resume_->bytes() != 0);
  if (waits != waits_) note_waiting(context);
  chunk_.let_go();
}

void Outbox::signal_room(EgressContext& context) {
  if (!paused_anyone()) return;
  if (has_share(context) && data_bytes() > budget(context).share_bytes() / 2) return;
  for (std::size_t lane = 0; lane < proto::kLaneCount; ++lane) {
    if (!lanes_->pauses.pauses(lane)) continue;
    const auto places = lanes_->queues[lane].places_with_room(context.limits.lane_bytes(lane));
    lanes_->pauses.on_room(static_cast<proto::Lane>(lane), places, context.signals);
  }
}

void Outbox::on_link_took(std::uint64_t bytes, bool emptied) {
  const auto limit =
      static_cast<std::uint32_t>(std::clamp(bytes, kLinkLaneBytesMin, kLinkLaneBytesMax));
  if (!emptied || (link_lane_bytes_ != 0 && limit > link_lane_bytes_)) link_lane_bytes_ = limit;
}

void Outbox::drop_all(proto::DropReason reason, EgressContext& context) {
  clear_control();
  if (lanes_) {
    drop_replay(reason, context);
    for (LaneQueue& lane : lanes_->queues) {
      lane.lose_all([](const Entry&) { return true; },
                    [&](Entry& entry) { lose(entry, reason, context); });
    }
    lanes_->open_messages.clear();
    lanes_->pauses.release_all(context.signals);
  }
  on_emptied(context);
}

void Outbox::drop_replay(proto::DropReason reason, EgressContext& context) {
  if (!lanes_) return;
  RingQueue<Run>& replay = lanes_->replay.runs();
  for (; !replay.empty(); replay.pop_front()) {
    const Run& run = replay.front();
    if (counted_ != nullptr) counted_->on_run_lost(run);
    count_dropped(run.frames, reason);
    context.tally.queued -= run.frames;
    context.drops.drop_mixed(run.bytes, run.size, reason);
  }
  lanes_->replay.clear();
}

std::uint64_t Outbox::waiting_messages(GroupId group) {
  if (!lanes_) return 0;
  std::uint64_t messages = 0;
  for (LaneQueue& lane : lanes_->queues) messages += lane.messages_of(group);
  return messages;
}

void Outbox::trim() {
  control_.trim();
  if (!lanes_) return;
  const bool idle = std::ranges::all_of(lanes_->queues, &LaneQueue::empty) &&
                    lanes_->replay.empty() && lanes_->pauses.empty() &&
                    lanes_->open_messages.empty() && !backlog_ && !has_untold_losses_;
  if (idle) return lanes_.reset();
  lanes_->replay.trim();
  for (LaneQueue& queue : lanes_->queues) queue.trim();
}

// The policies of docs/protocol.md, section 5, for a message that finds others waiting.

bool Outbox::join_message(Entry& entry, const proto::FrameHeader& header, EgressContext& context) {
  const std::size_t lane_index = header.lane & proto::kLaneMask;
  LaneQueue& lane = lanes_->queues[lane_index];
  Entry* message = lane.find_message(NodeId{header.src}, entry.message_number);
  if (message == nullptr) return false;
  // Of a message that is begun nothing is dropped or replaced any more: its frames wait in the
  // order in which they came, or a large one to a slow reader would hold up everybody else in its
  // lane until it ends.
  if (message->touched && message != &lane.entries().back()) return false;
  if (backlog_ && memory_refuses(entry, context)) {
    lose_for_room(entry, lane_index, proto::DropReason::over_budget, context);
    return true;
  }
  if (entry.block && finds_no_room(entry, lane_index, context) &&
      !ask_to_pause(entry, header, context)) {
    lose_for_room(entry, lane_index, proto::DropReason::queue_full, context);
    return true;
  }
  // The message may have been settled already, and is not looked at again.
  if (backlog_) settle_run(entry.run, entry.shared, context);
  lane.append_fragment(*message, std::move(entry.run), entry.complete, memory(context).pieces);
  return true;
}

void Outbox::push_in_pieces(const Run& run, const proto::FrameHeader& header, Handover handover,
                            EgressContext& context) {
  for (Run rest = run.share(); rest.frames != 0;) {
    const Leading piece = rest.leading([](const Leading& before, std::uint32_t next) {
      return before.frames == 0 || before.size + next <= kSharedChunkBytes;
    });
    push(rest.take_front(piece), header, handover, context);
  }
}

void Outbox::release_written(std::uint64_t bytes, EgressContext& context) {
  const std::uint64_t wanted = held_bytes() + bytes;
  const std::uint64_t share = budget(context).share_bytes();
  if (resume_ != nullptr && wanted > share) resume_->let_go(wanted - share, counted_);
}

/// Frames that were written go first: a connection that holds loses nothing by it. Then waiting
/// messages go, of the least urgent lane first, and of none more urgent than the entry's.
void Outbox::make_share(const Entry& entry, const proto::FrameHeader& header,
                        EgressContext& context) {
  if (!over_share(entry.size, context)) return;
  release_written(entry.size, context);
  if (entry.block || header.policy() == proto::Policy::drop) return;
  const std::uint64_t share = budget(context).share_bytes();
  for (std::size_t lane = proto::kLaneCount; lane-- > (header.lane & proto::kLaneMask);) {
    while (held_bytes() + entry.size > share &&
           drop_for_room(lane, proto::DropReason::over_budget, context))
      continue;
  }
}

void Outbox::admit(Entry entry, const proto::FrameHeader& header, EgressContext& context) {
  const std::size_t lane_index = header.lane & proto::kLaneMask;
  LaneQueue& lane = lanes_->queues[lane_index];
  if (entry.latest && !entry.touched) {
    Entry older;
    // It takes a place that may have been settled already, and is not looked at again.
    if (backlog_) settle_run(entry.run, entry.shared, context);
    if (lane.replace_latest(entry, older)) return lose(older, proto::DropReason::replaced, context);
  }
  if (memory_refuses(entry, context))
    return lose_for_room(entry, lane_index, proto::DropReason::over_budget, context);
  // At once, or neighbours in the read buffer would become one run.
  if (backlog_ && budget(context).scarce()) settle_run(entry.run, entry.shared, context);
  if (finds_no_room(entry, lane_index, context)) {
    if (!entry.block && !entry.touched) return admit_to_full(std::move(entry), header, context);
    if (entry.block && !ask_to_pause(entry, header, context))
      return lose_for_room(entry, lane_index, proto::DropReason::queue_full, context);
  }
  lane.push(std::move(entry));
}

void Outbox::admit_to_full(Entry entry, const proto::FrameHeader& header, EgressContext& context) {
  const std::size_t lane_index = header.lane & proto::kLaneMask;
  LaneQueue& lane = lanes_->queues[lane_index];
  LaneQueue::note_source(entry);
  // The new entry counts while a source is looked for that loses. One that is refused did not wait,
  // and so does not count in who filled the lane.
  const std::uint32_t size = entry.size;
  lane.sources().add(entry.source, size);
  if (header.policy() != proto::Policy::drop) make_room(entry, lane_index, context);
  lane.sources().take(entry.source, size);
  if (has_room(size, lane_index, context.limits)) return lane.push(std::move(entry));
  lose_for_room(entry, lane_index, proto::DropReason::queue_full, context);
}

bool Outbox::ask_to_pause(const Entry& entry, const proto::FrameHeader& header,
                          EgressContext& context) {
  const std::size_t lane_index = header.lane & proto::kLaneMask;
  LaneQueue& lane = lanes_->queues[lane_index];
  const std::uint64_t lane_bytes = context.limits.lane_bytes(lane_index);
  const bool by_share = backlog_ && has_share(context);
  if (!by_share && lane.is_within_share(NodeId{header.src}, entry.size, lane_bytes)) return true;
  const auto beyond = [](std::uint64_t bytes, std::uint64_t limit) {
    return std::max(bytes, limit) - limit;
  };
  PauseBook::Excess excess{beyond(lane.block_bytes() + entry.size, lane_bytes / 2),
                           context.limits.reserve_bytes, held_bytes() + entry.size};
  if (!budget(context).scarce()) excess.held_most = budget_bytes(context.limits) / kPartFromAfar;
  if (by_share) {
    const std::uint64_t share = budget(context).share_bytes();
    excess.bytes = std::max(excess.bytes, beyond(excess.held, share));
    excess.reserve = std::min(excess.reserve, share);
  }
  return lanes_->pauses.ask(header, entry.size, excess, context);
}

/// Drops waiting entries until the new one fits, each of the source that has the most bytes. Where
/// that is the new one's, and no other entry of it waits, the new one goes.
void Outbox::make_room(const Entry& entry, std::size_t lane_index, EgressContext& context) {
  LaneQueue& lane = lanes_->queues[lane_index];
  // Behind much of BLOCK the oldest messages would always be dropped before their turn came.
  const bool new_goes = lane.block_bytes() > lane_bytes(lane_index, false, context.limits) / 4;
  while (!fits(entry, lane_index, context.limits)) {
    const bool own = lane.sources().loser() == entry.source;
    if (own && (new_goes || lane.sources().droppable(entry.source) == entry.size)) return;
    if (!drop_for_room(lane_index, proto::DropReason::queue_full, context)) return;
  }
}

bool Outbox::drop_for_room(std::size_t lane_index, proto::DropReason reason,
                           EgressContext& context) {
  Entry older;
  if (!lanes_->queues[lane_index].drop_oldest(older)) return false;
  lose_for_room(older, lane_index, reason, context);
  return true;
}

void Outbox::lose_for_room(Entry& lost, std::size_t lane_index, proto::DropReason reason,
                           EgressContext& context) {
  if (lost.frames == 0) return;
  has_untold_losses_ = true;
  UntoldLosses& losses =
      reason == proto::DropReason::over_budget ? lanes_->of_short_memory : lanes_->of_full_lanes;
  losses.add(lost, lanes_->queues[lane_index], reason);
  lose(lost, reason, context);
}

void Outbox::lose(Entry& entry, proto::DropReason reason, EgressContext& context) {
  if (entry.frames == 0) return;
  if (entry.fragmented && !entry.complete) lanes_->open_messages.forget(entry);
  if (counted_ != nullptr) counted_->on_entry_lost(entry);
  count_dropped(entry.frames, reason);
  context.tally.queued -= entry.frames;
  do {
    if (entry.run.frames != 0) context.drops.drop(entry.run.bytes, entry.run.frames, reason);
  } while (entry.next_piece());
  entry.size = entry.frames = 0;
}

}  // namespace gimnet::hub
