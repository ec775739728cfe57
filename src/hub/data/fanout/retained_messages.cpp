#include "hub/data/fanout/retained_messages.hpp"

#include <algorithm>
#include <cstring>
#include <type_traits>
#include <utility>

#include "base/endian.hpp"
#include "proto/gimi/message_header.hpp"

namespace gimnet::hub {
namespace {

static_assert(std::is_trivially_copyable_v<GroupStart> && sizeof(GroupStart) <= sizeof Mail::small);

Mail mail_about(MailKind kind, const GroupStart& start) {
  Mail mail;
  mail.kind = kind;
  mail.small_size = sizeof start;
  std::memcpy(mail.small, &start, sizeof start);
  return mail;
}

/// Bytes that a message counts. It begins with a frame of `frame_bytes`.
std::uint64_t charge_of(const proto::FrameView& frame, std::uint32_t payload_bytes,
                        std::uint32_t frame_bytes) {
  const std::uint32_t data =
      proto::gimi::application_bytes(frame.key.has_value(), frame.payload, payload_bytes);
  return std::max(data, frame_bytes / 2);
}

/// For all frames of a fragmented message, where they are as large as the first; at most twice the
/// message and a frame.
std::uint32_t room_for(const proto::FrameView& first, std::uint32_t frame_bytes) {
  const std::uint64_t total = first.fragment->total;
  const std::uint64_t payload = first.payload.size();
  const std::uint64_t frames = (total + payload - 1) / payload;
  return static_cast<std::uint32_t>(
      std::min<std::uint64_t>(total + frames * (frame_bytes - payload), 2 * total + frame_bytes));
}

}  // namespace

RetainedMessages::Entry& RetainedMessages::entry(const proto::FrameHeader& header) {
  std::unique_ptr<Entry>& place = entries_[header.dst];
  if (!place) {
    place = std::make_unique<Entry>();
    place->group = header.dst;
  }
  if (place->provider != NodeId{header.src}) {
    let_go_all(*place);  // of another provider, whose session is not over, or not yet known to be
    set_provider(*place, NodeId{header.src});
  }
  return *place;
}

void RetainedMessages::set_provider(Entry& entry, NodeId provider) {
  leave_provider(entry);
  entry.provider = provider;
  Share& share = shares_[provider.value()];
  share.charged += entry.charged();
  entry.after = std::exchange(share.first, &entry);
  if (entry.after != nullptr) entry.after->before = &entry;
}

void RetainedMessages::leave_provider(Entry& entry) {
  const auto share = shares_.find(entry.provider.value());
  if (share != shares_.end()) share->second.charged -= entry.charged();
  if (entry.after != nullptr) entry.after->before = entry.before;
  if (entry.before != nullptr) {
    entry.before->after = entry.after;
  } else if (entry.after != nullptr) {
    share->second.first = entry.after;
  } else if (share != shares_.end()) {
    shares_.erase(share);
  }
  entry.before = entry.after = nullptr;
}

std::uint64_t RetainedMessages::Entry::charged() const {
  std::uint64_t bytes = last.charged;
  for (const Arriving& each : arriving) bytes += each.kept.charged;
  return bytes;
}

bool RetainedMessages::charge(const Entry& entry, Kept& kept, std::uint64_t bytes) {
  Share& share = shares_[entry.provider.value()];
  if (bytes > kept.charged) {
    const std::uint64_t more = bytes - kept.charged;
    if (share.charged + more > context_.limits.retained_budget_bytes / 2) return false;
    if (!budget_.lease(static_cast<std::int64_t>(more))) return false;
  } else {
    budget_.give_back(static_cast<std::int64_t>(kept.charged - bytes));
  }
  share.charged += bytes - kept.charged;  // wraps where it becomes less
  kept.charged = bytes;
  return true;
}

void RetainedMessages::let_go(const Entry& entry, Kept& kept) {
  kept.message.clear();
  static_cast<void>(charge(entry, kept, 0));
}

void RetainedMessages::let_go_all(Entry& entry) {
  if (entry.provider == NodeId{}) return;
  let_go(entry, entry.last);
  for (Arriving& each : entry.arriving) {
    each.open = false;
    let_go(entry, each.kept);
  }
}

void RetainedMessages::refuse(Entry& entry, const Run& run) {
  let_go(entry, entry.last);
  ++context_.tally.not_retained;
  context_.drops.tell(run.bytes, proto::DropReason::not_retained);
}

void RetainedMessages::keep(const Run& run, const proto::FrameHeader& header,
                            std::uint32_t last_bytes) {
  Entry& kept = entry(header);
  const Run last{run.buffer.share(), run.bytes + (run.size - last_bytes), last_bytes, 1};
  const auto frame = proto::parse_frame({last.bytes, last.size}, proto::Origin::hub);
  GIMNET_CHECK(frame);  // the gate parsed it
  if (frame->fragment) return keep_fragment(kept, last, *frame);
  Arriving& arriving = kept.arriving[header.lane & proto::kLaneMask];
  arriving.open = false;
  let_go(kept, arriving.kept);
  const std::uint64_t bytes =
      charge_of(*frame, static_cast<std::uint32_t>(frame->payload.size()), last.size);
  if (bytes > context_.limits.retained_message_bytes || !charge(kept, kept.last, bytes))
    return refuse(kept, last);
  kept.last.message.begin_copy(last.size, context_);
  kept.last.message.append_copy(last, context_);
}

void RetainedMessages::keep_fragment(Entry& entry, const Run& run, const proto::FrameView& frame) {
  const proto::FragmentHeader& fragment = *frame.fragment;
  Arriving& arriving = entry.arriving[frame.header.lane & proto::kLaneMask];
  if (fragment.offset == 0) begin_fragments(entry, arriving, run, frame);
  const bool follows =
      arriving.number == fragment.message && arriving.next_offset == fragment.offset;
  if (!arriving.open || !follows) {
    arriving.open = false;
    return let_go(entry, arriving.kept);
  }
  KeptMessage& message = arriving.kept.message;
  // Of many small pieces the headers are more than the data.
  const std::uint64_t half = (message.bytes() + run.size) / 2;
  if (!charge(entry, arriving.kept, std::max(arriving.kept.charged, half))) {
    arriving.open = false;
    let_go(entry, arriving.kept);
    return refuse(entry, run);
  }
  message.append_copy(run, context_);
  arriving.next_offset = fragment.offset + static_cast<std::uint32_t>(frame.payload.size());
  if (!frame.ends_message()) return;
  let_go(entry, entry.last);
  std::swap(entry.last, arriving.kept);
  arriving.open = false;
}

/// Beside the last message where there is room for both, else in its place.
void RetainedMessages::begin_fragments(Entry& entry, Arriving& arriving, const Run& run,
                                       const proto::FrameView& frame) {
  const proto::FragmentHeader& fragment = *frame.fragment;
  let_go(entry, arriving.kept);
  const std::uint64_t bytes = charge_of(frame, fragment.total, run.size);
  arriving.open = bytes <= context_.limits.retained_message_bytes;
  if (arriving.open && !charge(entry, arriving.kept, bytes)) {
    let_go(entry, entry.last);
    arriving.open = charge(entry, arriving.kept, bytes);
  }
  if (!arriving.open) return refuse(entry, run);
  arriving.number = fragment.message;
  arriving.next_offset = 0;
  arriving.kept.message.begin_copy(room_for(frame, run.size), context_);
}

void RetainedMessages::forget(GroupId group, NodeId provider) {
  const auto found = entries_.find(group.value());
  if (found == entries_.end() || found->second->provider != provider) return;
  budget_.give_back(static_cast<std::int64_t>(found->second->charged()));
  leave_provider(*found->second);
  entries_.erase(found);
}

void RetainedMessages::forget_provider(NodeId provider) {
  const auto found = shares_.find(provider.value());
  if (found == shares_.end()) return;
  budget_.give_back(static_cast<std::int64_t>(found->second.charged));
  Entry* each = found->second.first;
  shares_.erase(found);
  while (each != nullptr) {
    const std::uint32_t group =
        std::exchange(each, each->after)->group;  // not the one that goes with its entry
    entries_.erase(group);
  }
}

void RetainedMessages::renumber_provider(NodeId former, NodeId provider) {
  if (former == provider) return;
  for (auto found = shares_.find(former.value()); found != shares_.end();
       found = shares_.find(former.value())) {
    Entry& entry = *found->second.first;
    // A message that had begun to come does not go on.
    for (Arriving& each : entry.arriving) {
      each.open = false;
      let_go(entry, each.kept);
    }
    rename_source(entry.last.message, provider);
    set_provider(entry, provider);
  }
}

/// A copy: other shards may still read the message as it is.
void RetainedMessages::rename_source(KeptMessage& message, NodeId source) {
  if (message.empty()) return;
  KeptMessage renamed;
  renamed.begin_copy(static_cast<std::uint32_t>(message.bytes()), context_);
  message.for_each([&](const Run& run) {
    std::byte* const copy = renamed.append_copy(run, context_);
    for (std::size_t done = 0; done < run.size;
         done += proto::load_header(copy + done).frame_size()) {
      store_le(copy + done + proto::kSrcOffset, source.value());
    }
  });
  std::swap(message, renamed);
}

void RetainedMessages::on_start_wanted(const GroupStart& start) {
  // Frames that were routed before this moment are under way before the start.
  fanout_.post_all();
  if (start.shard == fanout_.self()) {
    on_start(start);
  } else {
    fanout_.post_word(start.shard, mail_about(MailKind::start, start));
  }
  const auto found = entries_.find(start.group.value());
  // The kept message may be of a former provider on this shard.
  if (found == entries_.end() || found->second->provider != start.provider) return;
  hand(start, found->second->last.message);
  for (const Arriving& arriving : found->second->arriving) hand(start, arriving.kept.message);
}

void RetainedMessages::hand(const GroupStart& start, const KeptMessage& message) {
  message.for_each([&](const Run& run) {
    context_.tally.copies += run.frames;
    context_.tally.queued += run.frames;
    if (start.shard == fanout_.self()) {
      // As a loan, too: it counts as a waiting message only while it waits.
      const Run lent{context_.pool.adopt(BufferPool::lend(*run.buffer.get())), run.bytes, run.size,
                     run.frames};
      return on_handed(start, lent);
    }
    Mail mail = mail_about(MailKind::retained, start);
    mail.bytes = run.bytes;
    mail.size = run.size;
    mail.frames = run.frames;
    mail.lent = BufferPool::lend(*run.buffer.get());
    // Full or not: a subscriber asks once.
    fanout_.post_word(start.shard, mail);
  });
}

void RetainedMessages::ask_start(PacedSubscription& subscription) {
  const GroupMembers* members = groups_.find(subscription.group());
  subscription.start_ticket = ++starts_;
  // Nothing is kept of a group that nobody provides.
  subscription.awaits_start = members != nullptr && members->provided();
  if (!subscription.awaits_start) return;
  const Recipient& recipient = subscription.recipient();
  const GroupStart start{subscription.group(),      recipient.slot, recipient.generation,
                         subscription.start_ticket, fanout_.self(), members->provider};
  if (members->provider_place.shard == fanout_.self()) return on_start_wanted(start);
  fanout_.post_word(members->provider_place.shard, mail_about(MailKind::start_wanted, start));
}

/// nullptr: it has asked for a later start since, or ended, and so, perhaps, has the group, whose
/// id is another's now.
PacedSubscription* RetainedMessages::subscription_of(const GroupStart& start) const {
  const Recipient* recipient = fanout_.recipients().find(start.slot, start.generation);
  if (recipient == nullptr || !recipient->paced) return nullptr;
  PacedSubscription* found = recipient->paced->find(start.group);
  return found != nullptr && found->start_ticket == start.ticket ? found : nullptr;
}

bool RetainedMessages::is_of_another(const GroupStart& start) const {
  const GroupMembers* members = groups_.find(start.group);
  return members != nullptr && members->provided() && members->provider != start.provider;
}

void RetainedMessages::on_start(const GroupStart& start) {
  PacedSubscription* subscription = subscription_of(start);
  if (subscription == nullptr) return;
  if (is_of_another(start)) return ask_start(*subscription);
  subscription->awaits_start = false;
}

void RetainedMessages::on_handed(const GroupStart& start, const Run& frames) {
  context_.tally.queued -= frames.frames;
  PacedSubscription* subscription = subscription_of(start);
  for (Run rest = frames.share(); rest.frames != 0;) {
    const Run frame = rest.take_frame();
    const bool taken = subscription != nullptr && !is_of_another(start) &&
                       pacer_.offer(*subscription, frame, frame.header(), Handover{});
    if (!taken) context_.drops.drop(frame.bytes, 1, proto::DropReason::no_subscriber);
  }
}

}  // namespace gimnet::hub
