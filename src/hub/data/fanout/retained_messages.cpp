#include "hub/data/fanout/retained_messages.hpp"

#include <cstring>
#include <type_traits>
#include <utility>

#include "proto/frame/frame_parser.hpp"

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

}  // namespace

RetainedMessages::Entry& RetainedMessages::entry(const proto::FrameHeader& header) {
  std::unique_ptr<Entry>& place = entries_[header.dst];
  if (!place) {
    place = std::make_unique<Entry>();
    place->group = header.dst;
  }
  if (place->provider != NodeId{header.src}) set_provider(*place, NodeId{header.src});
  return *place;
}

void RetainedMessages::set_provider(Entry& entry, NodeId provider) {
  leave_provider(entry);
  entry.provider = provider;
  Entry*& first = first_of_[provider.value()];
  entry.after = std::exchange(first, &entry);
  if (entry.after != nullptr) entry.after->before = &entry;
}

void RetainedMessages::leave_provider(Entry& entry) {
  if (entry.after != nullptr) entry.after->before = entry.before;
  if (entry.before != nullptr) {
    entry.before->after = entry.after;
  } else if (entry.after != nullptr) {
    first_of_[entry.provider.value()] = entry.after;
  } else {
    first_of_.erase(entry.provider.value());  // none if it is new
  }
  entry.before = entry.after = nullptr;
}

void RetainedMessages::keep(const Run& run, const proto::FrameHeader& header) {
  Entry& kept = entry(header);
  if (header.has(proto::kFlagFragment)) return keep_fragment(kept, run, header);
  Arriving& arriving = kept.arriving[header.lane & proto::kLaneMask];
  arriving.open = false;
  arriving.message.clear();
  Run last = run.share();
  while (last.frames > 1) last.skip_frame();
  kept.last.clear();
  if (may_keep(kept, last.size - proto::kHeaderSize)) kept.last.append(last, false, context_);
}

void RetainedMessages::keep_fragment(Entry& kept, const Run& run,
                                     const proto::FrameHeader& header) {
  const auto frame = proto::parse_frame({run.bytes, run.size}, proto::Origin::hub);
  GIMNET_CHECK(frame && frame->fragment);  // the gate parsed it
  const proto::FragmentHeader& fragment = *frame->fragment;
  Arriving& arriving = kept.arriving[header.lane & proto::kLaneMask];
  if (fragment.offset == 0) {
    arriving.message.clear();
    arriving.open = may_keep(kept, fragment.total);
    arriving.number = fragment.message;
    arriving.next_offset = 0;
  }
  const bool follows =
      arriving.number == fragment.message && arriving.next_offset == fragment.offset;
  if (!arriving.open || !follows) {
    arriving.open = false;
    return arriving.message.clear();
  }
  arriving.message.append(run, false, context_);
  arriving.next_offset = fragment.offset + static_cast<std::uint32_t>(frame->payload.size());
  if (!frame->ends_message()) return;
  kept.last.clear();
  std::swap(kept.last, arriving.message);
  arriving.open = false;
}

/// A message that cannot be kept leaves none behind: an older one would not be the last.
bool RetainedMessages::may_keep(Entry& kept, std::uint64_t bytes) {
  if (bytes <= context_.limits.retained_bytes && !context_.budget.exhausted()) return true;
  kept.last.clear();
  ++context_.tally.not_retained;
  return false;
}

void RetainedMessages::forget(GroupId group) {
  const auto found = entries_.find(group.value());
  if (found == entries_.end()) return;
  leave_provider(*found->second);
  entries_.erase(found);
}

void RetainedMessages::forget_provider(NodeId provider) {
  const auto found = first_of_.find(provider.value());
  Entry* each = found == first_of_.end() ? nullptr : found->second;
  first_of_.erase(provider.value());
  while (each != nullptr) {
    const std::uint32_t group =
        std::exchange(each, each->after)->group;  // not the one that goes with its entry
    entries_.erase(group);
  }
}

void RetainedMessages::renumber_provider(NodeId former, NodeId provider) {
  if (former == provider) return;
  for (auto found = first_of_.find(former.value()); found != first_of_.end();
       found = first_of_.find(former.value())) {
    set_provider(*found->second, provider);
  }
}

void RetainedMessages::on_start_wanted(const GroupStart& start) {
  // What was routed before this moment is under way before the start.
  fanout_.post_all();
  if (start.shard == fanout_.self()) {
    on_start(start);
  } else {
    fanout_.post_word(start.shard, mail_about(MailKind::start, start));
  }
  const auto found = entries_.find(start.group.value());
  if (found == entries_.end()) return;
  hand(start, found->second->last);
  for (const Arriving& arriving : found->second->arriving) hand(start, arriving.message);
}

void RetainedMessages::hand(const GroupStart& start, const KeptMessage& message) {
  message.for_each([&](const Run& run) {
    context_.tally.copies += run.frames;
    context_.tally.queued += run.frames;
    if (start.shard == fanout_.self()) return on_handed(start, run);
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
  const GroupMembers* members = groups_.find(index_of(subscription.group()));
  subscription.start_ticket = ++starts_;
  subscription.awaits_start = true;
  if (members == nullptr) return;  // the subscription is about to end
  const Recipient& recipient = subscription.recipient();
  const GroupStart start{subscription.group(), recipient.slot, recipient.generation,
                         subscription.start_ticket, fanout_.self()};
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

void RetainedMessages::on_start(const GroupStart& start) {
  PacedSubscription* subscription = subscription_of(start);
  if (subscription != nullptr) subscription->awaits_start = false;
}

void RetainedMessages::on_handed(const GroupStart& start, const Run& frames) {
  context_.tally.queued -= frames.frames;
  PacedSubscription* subscription = subscription_of(start);
  for (Run rest = frames.share(); rest.frames != 0;) {
    const Run frame = rest.take_frame();
    const bool taken = subscription != nullptr && subscription->active &&
                       pacer_.offer(*subscription, frame, frame.header(), Handover{});
    if (!taken) context_.drops.drop(frame.bytes, frame.size, 1, proto::DropReason::no_subscriber);
  }
}

}  // namespace gimnet::hub
