#include "hub/data/fanout/fanout.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

#include "base/endian.hpp"
#include "proto/frame/frame_header.hpp"

namespace gimnet::hub {

std::uint32_t ShardRecipients::count(ShardIndex shard, const std::byte* frame) const {
  const proto::FrameHeader header = proto::load_header(frame);
  switch (header.kind) {
    case proto::Kind::group:
      return count_members(shard, GroupId{header.dst});
    case proto::Kind::list:
      return header.dst;  // each shard gets the ids of its own nodes
    case proto::Kind::broadcast:
      return nodes_.nodes_on(shard);  // its sender lives where it was taken in
    default:
      return 1;
  }
}

std::uint32_t ShardRecipients::count_members(ShardIndex shard, GroupId group) const {
  const GroupMembers* members = groups_.find(group);
  if (members == nullptr) return 0;
  std::size_t there = members->by_shard[shard.value()].size();
  if (!members->paced_by_shard.empty()) there += members->paced_by_shard[shard.value()].size();
  return static_cast<std::uint32_t>(there);
}

Fanout::Fanout(ShardIndex self, std::vector<Mailbox*> mailboxes, RecipientTable& recipients,
               EgressContext& context, const ShardRecipients& elsewhere)
    : self_(self),
      mailboxes_(std::move(mailboxes)),
      recipients_(recipients),
      context_(context),
      elsewhere_(elsewhere) {
  GIMNET_CHECK(mailboxes_.size() <= kShardsMax);
  stretches_.resize(mailboxes_.size());
}

void Fanout::deliver(Recipient& recipient, const Run& run, const proto::FrameHeader& header,
                     Handover handover) {
  context_.owner.check_here();
  if (!recipient.connected && !recipient.waits_when_away) {
    lose(recipient, run, header, proto::DropReason::away);
    return;
  }
  // Only the first frame's length is in `header`; what is short altogether has no long frame in it.
  if (run.size - proto::kHeaderSize <= recipient.frame_bytes ||
      recipient.frame_bytes >= context_.limits.frame_bytes) {
    push(recipient, run, header, handover);
    return;
  }
  deliver_short_ones(recipient, run, header, handover);
}

void Fanout::deliver_short_ones(Recipient& recipient, const Run& run,
                                const proto::FrameHeader& header, Handover handover) {
  const std::uint64_t longest = recipient.frame_bytes + proto::kHeaderSize;
  for (Run rest = run.share(); rest.frames != 0;) {
    const bool short_enough = rest.header().frame_size() <= longest;
    const Run alike = rest.take_front(rest.leading(
        [&](const Leading&, std::uint32_t next) { return (next <= longest) == short_enough; }));
    if (short_enough) {
      push(recipient, alike, header, handover);
    } else {
      lose(recipient, alike, header, proto::DropReason::too_large);
    }
  }
}

void Fanout::lose(const Recipient& recipient, const Run& run, const proto::FrameHeader& header,
                  proto::DropReason reason) {
  recipient.outbox.tell_lost(run, header);
  recipient.outbox.count_dropped(run.frames, reason);
  context_.drops.drop(run.bytes, run.frames, reason);
}

void Fanout::push(Recipient& recipient, const Run& run, const proto::FrameHeader& header,
                  Handover handover) {
  recipient.outbox.push(run, header, handover, context_);
  recipients_.mark_dirty(recipient);
}

void Fanout::hand_over(ShardIndex to, const Run& run, std::size_t deliveries) {
  context_.owner.check_here();
  Stretch& stretch = stretches_[to.value()];
  if (stretch.open.frames != 0) {
    if (stretch.open.extend(run) || gather(stretch, run)) {
      stretch.deliveries += static_cast<std::uint32_t>(deliveries);
      return;
    }
    post(to);
  }
  stretch.deliveries = static_cast<std::uint32_t>(deliveries);
  stretch.open = run.share();
  open_shards_ |= std::uint64_t{1} << to.value();
}

/// Frames that alternate between shards would each have an entry of their own. Order: what was
/// handed over stands in `open` in the order in which it came, and is posted before anything that
/// does not fit behind it. The other shard reads only bytes that were written before the entry was
/// posted, and those are never written again while it may read them: later frames go behind them,
/// or into a chunk of which no loan is open.
bool Fanout::gather(Stretch& stretch, const Run& run) {
  if (run.size >= kGatherBytesMax) return false;
  const Run& open = stretch.open;
  const bool gathered = stretch.chunk && open.buffer.get() == stretch.chunk.get() &&
                        open.bytes + open.size == stretch.chunk->data + stretch.chunk_used;
  if (!gathered) {
    if (open.size >= kGatherBytesMax) return false;
    make_room(stretch, open.size + run.size);
    const std::byte* const begin = copy_behind(stretch, open);
    stretch.open = Run{stretch.chunk.share(), begin, open.size, open.frames};
  } else if (stretch.chunk->capacity - stretch.chunk_used < run.size) {
    return false;
  }
  static_cast<void>(copy_behind(stretch, run));
  stretch.open.size += run.size;
  stretch.open.frames += run.frames;
  return true;
}

void Fanout::make_room(Stretch& stretch, std::uint32_t bytes) {
  // acquire pairs with the release in BufferPool::end_loan(): the other shard has read its last
  // byte.
  if (stretch.chunk && stretch.chunk->references == 1 &&
      stretch.chunk->lent.load(std::memory_order_acquire) == 0) {
    stretch.chunk_used = 0;
  }
  if (stretch.chunk && stretch.chunk->capacity - stretch.chunk_used >= bytes) return;
  stretch.chunk = context_.pool.take_chunk(kGatherChunkBytes);
  stretch.chunk_used = 0;
}

std::byte* Fanout::copy_behind(Stretch& stretch, const Run& run) {
  std::byte* const place = stretch.chunk->data + stretch.chunk_used;
  std::memcpy(place, run.bytes, run.size);
  stretch.chunk_used += run.size;
  context_.tally.copied_bytes += run.size;
  return place;
}

void Fanout::post_all() {
  while (open_shards_ != 0) {
    post(ShardIndex{static_cast<std::uint8_t>(std::countr_zero(open_shards_))});
  }
}

void Fanout::post(ShardIndex to) {
  Run run = std::exchange(stretches_[to.value()].open, Run{});
  open_shards_ &= ~(std::uint64_t{1} << to.value());
  posted_ |= std::uint64_t{1} << to.value();
  if (mailboxes_[to.value()]->full(self_, run.size)) {
    put_blocking_only(to, run);
  } else {
    put(to, run, stretches_[to.value()].deliveries);
  }
  if (mailboxes_[to.value()]->crowded(self_)) crowded_ |= std::uint64_t{1} << to.value();
}

void Fanout::put_blocking_only(ShardIndex to, const Run& run) {
  Run rest = run.share();
  Run blocking;
  while (rest.frames != 0) {
    Run frame = rest.take_frame();
    const bool block = proto::is_block(frame.header());
    if (block && blocking.extend(frame)) continue;
    if (blocking.frames != 0) put(to, std::exchange(blocking, Run{}));
    if (block) {
      blocking = std::move(frame);
    } else {
      drop_for(to, frame);
    }
  }
  if (blocking.frames != 0) put(to, blocking);
}

void Fanout::drop_for(ShardIndex to, const Run& frame) {
  const std::uint32_t recipients = elsewhere_.count(to, frame.bytes);
  // The last of them may have left since the frame was handed over.
  const std::uint32_t outcomes = std::max<std::uint32_t>(recipients, 1);
  const auto reason =
      recipients == 0 ? proto::DropReason::no_subscriber : proto::DropReason::shard_full;
  context_.tally.copies += outcomes - 1;
  const proto::FrameHeader header = frame.header();
  const bool list = header.kind == proto::Kind::list;
  context_.drops.drop(frame.bytes + (list ? list_frame_offset(header.dst) : 0), outcomes, reason);
}

void Fanout::put(ShardIndex to, const Run& run, std::uint32_t deliveries) {
  context_.tally.queued += run.frames;
  context_.tally.mailbox_entries += 1;
  context_.tally.mailbox_frames += run.frames;
  Mail mail;
  mail.kind = MailKind::frames;
  mail.bytes = run.bytes;
  mail.size = run.size;
  mail.frames = run.frames;
  mail.lent = BufferPool::lend(*run.buffer.get());
  Mailbox& mailbox = *mailboxes_[to.value()];
  if (deliveries != 0) mail.set_deliveries(deliveries);
  if (deliveries != 0 ? mailbox.post_to_many(self_, mail) : mailbox.post(self_, mail)) ++wakeups_;
}

Run Fanout::copy_without_ids(const Run& frame, const proto::FrameHeader& header) {
  context_.owner.check_here();
  const auto size = static_cast<std::uint32_t>(header.frame_size());
  std::byte* const place = list_room(size);
  write_without_ids(place, frame, header);
  return Run{lists_.share(), place, size, 1};
}

std::byte* Fanout::write_ids(std::byte* to, std::span<const NodeId> ids) {
  for (const NodeId id : ids) {
    store_le(to, id.value());
    to += kNodeIdBytes;
  }
  return to;
}

Run Fanout::copy_for(std::span<const NodeId> ids, const Run& frame,
                     const proto::FrameHeader& header) {
  const std::uint32_t offset = list_frame_offset(static_cast<std::uint32_t>(ids.size()));
  const auto size = static_cast<std::uint32_t>(offset + header.frame_size());
  std::byte* const place = list_room(size);
  proto::FrameHeader outer = header;
  outer.dst = static_cast<std::uint32_t>(ids.size());
  outer.length = size - static_cast<std::uint32_t>(proto::kHeaderSize);
  proto::store_header(place, outer);
  write_without_ids(write_ids(place + proto::kHeaderSize, ids), frame, header);
  return Run{lists_.share(), place, size, 1};
}

Run Fanout::copy_with_ids(std::span<const NodeId> ids, const Run& frame,
                          const proto::FrameHeader& header) {
  const auto size = static_cast<std::uint32_t>(header.frame_size());
  std::byte* const place = list_room(size);
  proto::store_header(place, header);
  std::byte* const rest = write_ids(place + proto::kHeaderSize, ids);
  const std::uint32_t rest_bytes = frame.size - static_cast<std::uint32_t>(proto::kHeaderSize);
  std::memcpy(rest, frame.bytes + proto::kHeaderSize, rest_bytes);
  context_.tally.copied_bytes += rest_bytes;
  return Run{lists_.share(), place, size, 1};
}

std::byte* Fanout::list_room(std::uint32_t bytes) {
  // acquire pairs with the release in BufferPool::end_loan(), as in make_room().
  if (lists_ && lists_->references == 1 && lists_->lent.load(std::memory_order_acquire) == 0)
    lists_used_ = 0;
  if (!lists_ || lists_->capacity - lists_used_ < bytes) {
    lists_ = bytes <= kListChunkBytes ? context_.pool.take_chunk(kListChunkBytes)
                                      : context_.pool.take_slab();
    lists_used_ = 0;
  }
  return lists_->data + std::exchange(lists_used_, lists_used_ + bytes);
}

void Fanout::write_without_ids(std::byte* to, const Run& frame, const proto::FrameHeader& header) {
  proto::store_header(to, header);
  std::memcpy(to + proto::kHeaderSize, frame.bytes + frame.size - header.length, header.length);
  context_.tally.copied_bytes += header.length;
}

void Fanout::look_for_room() {
  for (std::uint64_t shards = crowded_; shards != 0; shards &= shards - 1) {
    const int shard = std::countr_zero(shards);
    if (!mailboxes_[static_cast<std::size_t>(shard)]->crowded(self_))
      crowded_ &= ~(std::uint64_t{1} << shard);
  }
}

void Fanout::post_last() {
  post_all();
  Mail mail;
  mail.kind = MailKind::last;
  mail.small_size = sizeof self_;
  std::memcpy(mail.small, &self_, sizeof self_);
  for (std::size_t shard = 0; shard < mailboxes_.size(); ++shard) {
    if (shard != self_.value()) post_word(ShardIndex{static_cast<std::uint8_t>(shard)}, mail);
  }
}

void Fanout::post_word(ShardIndex to, Mail mail) {
  if (mailboxes_[to.value()]->post(self_, mail)) ++wakeups_;
}

}  // namespace gimnet::hub
