#include <algorithm>
#include <array>
#include <utility>

#include "hub/data/egress/outbox.hpp"

// The policies of docs/protocol.md, section 5, for a message that finds others waiting.

namespace gimnet::hub {

bool Outbox::join_message(Entry& entry, const proto::FrameHeader& header, EgressContext& context) {
  LaneQueue& lane = lanes_->queues[header.lane & proto::kLaneMask];
  Entry* message = lane.find_message(NodeId{header.src}, entry.message_number);
  if (message == nullptr) return false;
  // Of a message that is begun nothing is dropped or replaced any more: its frames wait in the
  // order in which they came, or a large one to a slow reader would hold up everybody else in its
  // lane until it ends.
  if (message->touched && message != &lane.entries().back()) return false;
  if (backlog_ && memory_refuses(entry, context)) {
    lose_for_room(entry, header.lane & proto::kLaneMask, proto::DropReason::over_budget, context);
    return true;
  }
  const bool over = !fits(entry, header.lane & proto::kLaneMask, context.limits) ||
                    (backlog_ && over_share(entry.size, context));
  if (over && entry.block && !ask_to_pause(entry, header, context)) {
    lose_for_room(entry, header.lane & proto::kLaneMask, proto::DropReason::queue_full, context);
    return true;
  }
  // The message may have been settled already, and is not looked at again.
  if (backlog_) settle_run(entry.run, entry.shared, context);
  lane.append_fragment(*message, std::move(entry.run), entry.complete, context.pieces);
  return true;
}

std::vector<Outbox::OpenMessage>::iterator Outbox::find_open(const proto::FragmentStream& stream) {
  return std::ranges::find(lanes_->open_messages, stream, &OpenMessage::stream);
}

void Outbox::open_message(const OpenMessage& message) {
  std::vector<OpenMessage>& open = lanes_->open_messages;
  if (open.size() == kOpenMessagesMax) {
    std::array<proto::Holding, kOpenMessagesMax> holdings;
    std::ranges::transform(open, holdings.begin(), [](const OpenMessage& each) -> proto::Holding {
      return {.src = each.stream.src, .amount = 1};
    });
    open.erase(open.begin() +
               static_cast<std::ptrdiff_t>(proto::first_of_fullest_source(holdings)));
  }
  open.push_back(message);
}

bool Outbox::follow_message(const Entry& entry, EgressContext& context) {
  const proto::FragmentStream stream = proto::FragmentStream::of(entry.run.header());
  const auto found = find_open(stream);
  const bool known = found != lanes_->open_messages.end();
  if (!entry.touched || (known && found->number == entry.message_number)) {
    // A beginning ends the stream's message before it, whatever became of that one.
    if (known && (entry.complete || !entry.touched)) lanes_->open_messages.erase(found);
    if (!entry.complete && !entry.touched) open_message({stream, entry.message_number});
    return true;
  }
  tell_lost(entry);
  count_dropped(entry.frames);
  context.tally.queued -= entry.frames;
  context.drops.drop(entry.run.bytes, entry.run.frames, proto::DropReason::cut_message);
  return false;
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
  const std::uint64_t share = context.budget.share_bytes();
  if (resume_ != nullptr && wanted > share) resume_->let_go(wanted - share, counted_);
}

/// Frames that were written go first: a connection that holds loses nothing by it. Then waiting
/// messages go, of the least urgent lane first, and of none more urgent than the entry's.
void Outbox::make_share(const Entry& entry, const proto::FrameHeader& header,
                        EgressContext& context) {
  if (!over_share(entry.size, context)) return;
  release_written(entry.size, context);
  if (entry.block || header.policy() == proto::Policy::drop) return;
  const std::uint64_t share = context.budget.share_bytes();
  for (std::size_t lane = proto::kLaneCount; lane-- > (header.lane & proto::kLaneMask);) {
    while (held_bytes() + entry.size > share &&
           drop_for_room(lane, proto::DropReason::over_budget, context))
      continue;
  }
}

void Outbox::admit(Entry entry, const proto::FrameHeader& header, EgressContext& context) {
  LaneQueue& lane = lanes_->queues[header.lane & proto::kLaneMask];
  if (entry.latest && !entry.touched) {
    Entry older;
    // It takes a place that may have been settled already, and is not looked at again.
    if (backlog_) settle_run(entry.run, entry.shared, context);
    if (lane.replace_latest(entry, older)) {
      lose(older, proto::DropReason::replaced, context);
      return;
    }
  }
  if (memory_refuses(entry, context)) {
    lose_for_room(entry, header.lane & proto::kLaneMask, proto::DropReason::over_budget, context);
    return;
  }
  const bool scarce = backlog_ && context.budget.scarce();
  // At once, or neighbours in the read buffer would become one run.
  if (scarce) settle_run(entry.run, entry.shared, context);
  if (fits(entry, header.lane & proto::kLaneMask, context.limits) &&
      !(scarce && over_share(entry.size, context))) {
    lane.push(std::move(entry));
  } else if (entry.block) {
    if (ask_to_pause(entry, header, context)) {
      lane.push(std::move(entry));
    } else {
      lose_for_room(entry, header.lane & proto::kLaneMask, proto::DropReason::queue_full, context);
    }
  } else if (entry.touched) {
    lane.push(std::move(entry));
  } else {
    admit_to_full(std::move(entry), header, context);
  }
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

/// Senders of other hubs that one outbox pauses. More of them are dropped once the reserves are
/// used up.
constexpr std::size_t kPausedAfarMost = 4'096;

bool Outbox::ask_to_pause(const Entry& entry, const proto::FrameHeader& header,
                          EgressContext& context) {
  const std::size_t lane = header.lane & proto::kLaneMask;
  const Limits& limits = context.limits;
  const auto beyond = [](std::uint64_t bytes, std::uint64_t limit) {
    return bytes - std::min(bytes, limit);
  };
  std::uint64_t bytes =
      beyond(lanes_->queues[lane].block_bytes() + entry.size, limits.lane_bytes(lane) / 2);
  std::uint64_t reserve = limits.reserve_bytes;
  if (backlog_ && context.budget.scarce()) {
    const std::uint64_t share = context.budget.share_bytes();
    bytes = std::max(bytes, beyond(held_bytes() + entry.size, share));
    reserve = std::min(reserve, share);
  }
  // A link is always read, so nobody behind it can be held; and it may name any source.
  const bool afar = hub_of(NodeId{header.src}) != context.hub;
  std::uint64_t since_held = 0;
  if (!afar || lanes_->pauses.size() < kPausedAfarMost) {
    since_held = lanes_->pauses.on_full(NodeId{header.src},
                                        {header.kind, static_cast<proto::Lane>(lane), header.dst},
                                        entry.size, bytes > reserve, context.signals);
  }
  // Many senders may come at once: each is held, and loses nothing. What one of them had under way
  // by then was in its shard's mailbox to this one, or came with the reads before its shard heard
  // of the hold.
  const std::uint64_t reserves = kReservesMax * reserve;
  const bool comes_though_held = since_held > limits.mailbox_bytes + limits.turn_bytes + reserves;
  return (!comes_though_held && !afar) || bytes <= reserves;
}

/// Drops waiting entries until the new one fits, each of the source that has the most bytes. Where
/// that is the new one's, and no other entry of it waits, the new one goes.
void Outbox::make_room(const Entry& entry, std::size_t lane_index, EgressContext& context) {
  LaneQueue& lane = lanes_->queues[lane_index];
  // Behind much of BLOCK the oldest messages would always be dropped before their turn came.
  const bool new_goes = lane.block_bytes() > context.limits.lane_bytes(lane_index) / 4;
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
  lanes_->losses.add(lost, lanes_->queues[lane_index], reason);
  lose(lost, reason, context);
}

void Outbox::lose(Entry& entry, proto::DropReason reason, EgressContext& context) {
  if (entry.frames == 0) return;
  if (entry.fragmented && !entry.complete) {
    const auto open = find_open(proto::FragmentStream::of(entry.run.header()));
    if (open != lanes_->open_messages.end() && open->number == entry.message_number)
      lanes_->open_messages.erase(open);
  }
  tell_lost(entry);
  count_dropped(entry.frames);
  context.tally.queued -= entry.frames;
  do {
    if (entry.run.frames != 0) context.drops.drop(entry.run.bytes, entry.run.frames, reason);
  } while (entry.next_piece());
  entry.size = entry.frames = 0;
}

}  // namespace gimnet::hub
