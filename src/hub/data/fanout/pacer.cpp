#include "hub/data/fanout/pacer.hpp"

#include <algorithm>
#include <utility>

#include "proto/frame/frame_parser.hpp"

namespace gimnet::hub {
namespace {

using proto::DropReason;
using State = PacedSubscription::Open::State;

}  // namespace

PacedSubscription& Pacer::subscribe(Recipient& recipient, GroupId group, const PaceTerms& terms,
                                    bool was_plain, std::uint8_t number) {
  if (!recipient.paced) {
    recipient.paced = std::make_unique<PacedBook>(recipient, ripe_);
    recipient.outbox.set_counted_groups(recipient.paced.get());
  }
  PacedSubscription* known = recipient.paced->find(group);
  if (known == nullptr) {
    known = &recipient.paced->add(group, terms);
    known->begin_counts(number, recipient.outbox.waiting_messages(group));
    if (was_plain) begin_plain(*known);
  }
  if (!(known->terms() == terms)) {
    unschedule(*known);  // it may be due earlier now
    known->set_terms(terms);
  }
  // Messages that may go now need not be held, so the new depth does not drop them.
  release(*known);
  while (known->held() > known->terms().depth) drop_oldest(*known, DropReason::replaced);
  return *known;
}

void Pacer::begin_counts(Recipient& recipient, GroupId group, std::uint8_t number) {
  PacedSubscription* known = find(recipient, group);
  if (known == nullptr) return;
  known->begin_counts(number, recipient.outbox.waiting_messages(group));
  release(*known);
}

void Pacer::unsubscribe(Recipient& recipient, GroupId group) {
  PacedSubscription* known = recipient.paced ? recipient.paced->find(group) : nullptr;
  if (known == nullptr) return;
  drop_held(*known, DropReason::no_subscriber);
  unschedule(*known);
  recipient.paced->erase(*known);
}

PacedSubscription* Pacer::find(const Recipient& recipient, GroupId group) {
  return recipient.paced ? recipient.paced->find(group) : nullptr;
}

bool Pacer::offer(PacedSubscription& subscription, const Run& run, const proto::FrameHeader& header,
                  Handover handover) {
  if (subscription.awaits_start) return false;
  follow_source(subscription, NodeId{header.src});
  const Recipient& recipient = subscription.recipient();
  if (!recipient.connected && !recipient.waits_when_away) {
    drop(subscription, run, DropReason::away);
  } else if (header.has(proto::kFlagFragment)) {
    give_up_stalled(subscription);
    offer_fragment(subscription, run, header, handover);
    release(subscription);  // a message that was given up made room
  } else {
    give_up_stalled(subscription);
    Open& open = subscription.open(header.lane & proto::kLaneMask);
    abandon(subscription, open, DropReason::cut_message);
    offer_plain(subscription, run, header, handover);
  }
  return true;
}

/// Another provider does not end what the former one began.
void Pacer::follow_source(PacedSubscription& subscription, NodeId source) {
  if (std::exchange(subscription.source, source) == source) return;
  for (Open& open : subscription.open()) {
    if (open.state != State::plain) abandon(subscription, open, DropReason::cut_message);
  }
}

/// A message is the subscriber's whole or not at all, also where its pace begins within one.
void Pacer::begin_plain(PacedSubscription& subscription) const {
  for (Open& open : subscription.open()) {
    open.state = State::plain;
    open.came_ms = context_.now_ms;
  }
}

/// A message that its provider gave up in one lane, and not in another, would keep its place.
void Pacer::give_up_stalled(PacedSubscription& subscription) {
  for (Open& open : subscription.open()) {
    if (open.state == State::none || context_.now_ms - open.came_ms < context_.limits.block_ms)
      continue;
    abandon(subscription, open, DropReason::cut_message);
  }
}

void Pacer::offer_plain(PacedSubscription& subscription, const Run& run,
                        const proto::FrameHeader& header, Handover handover) {
  const bool any_time = subscription.terms().interval_us == 0;
  if (subscription.held() == 0 && any_time && subscription.space() >= run.frames) {
    return pass(subscription, run, run.frames, header, handover);
  }
  Run rest = run.share();
  const Outbox& outbox = subscription.recipient().outbox;
  const std::size_t lane = header.lane & proto::kLaneMask;
  // Messages that were released and lost at once make room for more.
  while (rest.frames != 0 && subscription.held() == 0 && subscription.may_begin(now_us())) {
    // A full outbox refuses them, and would refuse each of a long run by itself.
    if (header.policy() == proto::Policy::drop &&
        !outbox.has_room(rest.header().frame_size(), lane, context_.limits))
      return drop(subscription, rest, DropReason::queue_full);
    const std::uint64_t most = any_time ? subscription.space() : 1;
    subscription.on_begun(now_us());
    const Run begun = rest.take_front(
        rest.leading([&](const Leading& before, std::uint32_t) { return before.frames < most; }));
    pass(subscription, begun, begun.frames, header, handover);
  }
  if (rest.frames != 0) hold_newest(subscription, std::move(rest), lane, handover);
  release(subscription);
}

/// As if each had come alone and replaced an older one; what would have been held for a moment is
/// never kept.
void Pacer::hold_newest(PacedSubscription& subscription, Run rest, std::size_t lane,
                        Handover handover) {
  if (budget(subscription).exhausted()) return drop(subscription, rest, DropReason::over_budget);
  const std::uint32_t depth = subscription.terms().depth;
  if (rest.frames > depth) {
    while (subscription.held() != 0) drop_oldest(subscription, DropReason::replaced);
    const std::uint32_t passed_over = rest.size - last_frames_.bytes_of(depth);
    drop(subscription, rest.take_front({rest.frames - depth, passed_over}), DropReason::replaced);
  }
  while (rest.frames != 0) {
    const Run frame = rest.take_frame();
    if (budget(subscription).exhausted() || !make_share(subscription, frame.size)) {
      drop(subscription, frame, DropReason::over_budget);
    } else {
      keep(subscription, scratch_, frame, handover);
      hold(subscription, scratch_, lane);
    }
  }
}

void Pacer::offer_fragment(PacedSubscription& subscription, const Run& run,
                           const proto::FrameHeader& header, Handover handover) {
  Open& open = subscription.open(header.lane & proto::kLaneMask);
  const auto frame = proto::parse_frame({run.bytes, run.size}, proto::Origin::hub);
  GIMNET_CHECK(frame && frame->fragment);  // the gate parsed it
  const proto::FragmentHeader& fragment = *frame->fragment;
  const auto size = static_cast<std::uint32_t>(frame->payload.size());
  const bool ends = frame->ends_message();
  if (open.state == State::plain) {
    open.state = State::passing;
    open.number = fragment.message;
    open.next_offset = fragment.offset;
  }
  if (fragment.offset == 0) {
    abandon(subscription, open, DropReason::cut_message);
    begin_message(subscription, open, fragment.message);
  } else if (open.state == State::none || open.number != fragment.message ||
             open.next_offset != fragment.offset) {
    abandon(subscription, open, DropReason::cut_message);
    return drop(subscription, run, DropReason::cut_message);
  }
  open.next_offset = fragment.offset + size;
  open.came_ms = context_.now_ms;
  if (open.state == State::arriving &&
      (budget(subscription).exhausted() || !make_share(subscription, run.size))) {
    abandon(subscription, open, DropReason::over_budget);
    open.state = State::cut;
  }
  switch (open.state) {
    case State::passing:
      // Until its last frame it counts as under way by itself, from then on by that frame.
      if (ends) open.state = State::none;
      return pass(subscription, run, ends ? 1 : 0, header, handover);
    case State::arriving:
      keep(subscription, open.message, run, handover);
      if (ends) end_message(subscription, open);
      return;
    case State::cut:
    case State::plain:
    case State::none:
      drop(subscription, run, DropReason::cut_message);
      if (ends) open.state = State::none;
  }
}

void Pacer::begin_message(PacedSubscription& subscription, Open& open, std::uint32_t number) {
  open.number = number;
  open.next_offset = 0;
  const bool now = subscription.held() == 0 && subscription.may_begin(now_us());
  if (now) subscription.on_begun(now_us());
  open.state = now ? State::passing : State::arriving;
}

void Pacer::end_message(PacedSubscription& subscription, Open& open) {
  open.state = State::none;
  hold(subscription, open.message, static_cast<std::size_t>(&open - subscription.open().data()));
}

void Pacer::abandon(PacedSubscription& subscription, Open& open, DropReason reason) {
  drop(subscription, open.message, reason);
  open.message.clear();
  open.state = State::none;
}

void Pacer::pass(PacedSubscription& subscription, const Run& run, std::uint32_t ended,
                 const proto::FrameHeader& header, Handover handover) {
  subscription.on_sent(ended);
  fanout_.deliver(subscription.recipient(), run, header, handover);
}

/// Room for a frame that is to be held, in its subscriber's share. What was written goes first,
/// then the oldest messages of the subscription.
bool Pacer::make_share(PacedSubscription& subscription, std::uint64_t bytes) {
  Outbox& outbox = subscription.recipient().outbox;
  if (!outbox.over_share(bytes, context_)) return true;
  outbox.release_written(bytes, context_);
  while (outbox.over_share(bytes, context_)) {
    if (subscription.held() == 0) return false;
    drop_oldest(subscription, DropReason::over_budget);
  }
  return true;
}

void Pacer::keep(PacedSubscription& subscription, KeptMessage& message, const Run& frame,
                 Handover handover) {
  message.append(frame, handover.fan_out, budget(subscription), context_);
  context_.tally.queued += 1;
  subscription.recipient().outbox.add_paced(frame.size, context_);
}

/// The message is not held any more, or goes on to the outbox, which counts it then.
void Pacer::uncount(PacedSubscription& subscription, const KeptMessage& message) {
  if (message.empty()) return;
  context_.tally.queued -= message.frames();
  subscription.recipient().outbox.remove_paced(message.bytes(), context_);
}

void Pacer::hold(PacedSubscription& subscription, KeptMessage& message, std::size_t lane) {
  while (subscription.held() >= subscription.terms().depth)
    drop_oldest(subscription, DropReason::replaced);
  const std::uint64_t limit = context_.limits.lane_bytes(lane);
  while (subscription.held() != 0 && subscription.held_bytes() + message.bytes() > limit)
    drop_oldest(subscription, DropReason::queue_full);
  subscription.push_newest(message);
}

void Pacer::drop_oldest(PacedSubscription& subscription, DropReason reason) {
  drop(subscription, subscription.oldest(), reason);
  subscription.pop_oldest();
}

void Pacer::drop_held(PacedSubscription& subscription, DropReason reason) {
  while (subscription.held() != 0) drop_oldest(subscription, reason);
  for (Open& open : subscription.open()) abandon(subscription, open, reason);
}

void Pacer::drop(PacedSubscription& subscription, const KeptMessage& message, DropReason reason) {
  uncount(subscription, message);
  message.for_each([&](const Run& run) {
    subscription.recipient().outbox.count_dropped(run.frames, reason);
    context_.drops.drop(run.bytes, run.frames, reason);
  });
}

void Pacer::drop(PacedSubscription& subscription, const Run& run, DropReason reason) {
  subscription.recipient().outbox.count_dropped(run.frames, reason);
  context_.drops.drop(run.bytes, run.frames, reason);
}

bool Pacer::on_credit(const Recipient& recipient, const proto::flow::Credit& credit) {
  PacedSubscription* known = find(recipient, credit.group);
  if (known == nullptr) return false;
  if (known->number() != credit.number) return true;
  const bool possible = known->on_credit(credit.taken);
  release(*known);
  return possible;
}

void Pacer::release(PacedSubscription& subscription) {
  while (subscription.may_begin(now_us()) && subscription.held() != 0) {
    // With a time between two, what is not the newest would only be older by then.
    while (subscription.terms().interval_us != 0 && subscription.held() > 1) {
      drop_oldest(subscription, DropReason::replaced);
    }
    release_oldest(subscription);
  }
  while (subscription.held() == 0 && subscription.may_begin(now_us()) &&
         release_open(subscription)) {
  }
  schedule(subscription);
}

void Pacer::release_oldest(PacedSubscription& subscription) {
  subscription.on_begun(now_us());
  subscription.on_sent(1);
  write_kept(subscription, subscription.oldest());
  subscription.pop_oldest();
}

/// A message of which the beginning has come goes on as it comes.
bool Pacer::release_open(PacedSubscription& subscription) {
  for (Open& open : subscription.open()) {
    if (open.state != State::arriving) continue;
    open.state = State::passing;
    subscription.on_begun(now_us());
    write_kept(subscription, open.message);
    open.message.clear();
    return true;
  }
  return false;
}

void Pacer::write_kept(PacedSubscription& subscription, const KeptMessage& message) {
  uncount(subscription, message);
  message.for_each([&](const Run& run) {
    for (Run rest = run.share(); rest.frames != 0;) {
      const Run frame = rest.take_frame();
      fanout_.deliver(subscription.recipient(), frame, frame.header(), Handover{});
    }
  });
}

void Pacer::on_new_epoch(Recipient& recipient) {
  if (!recipient.paced) return;
  recipient.paced->for_each([&](PacedSubscription& each) {
    each.begin_counts(each.number(), recipient.outbox.waiting_messages(each.group()));
    release(each);
  });
}

void Pacer::on_away(Recipient& recipient) {
  if (!recipient.paced) return;
  bool any = false;
  recipient.paced->for_each([&](PacedSubscription& each) {
    drop_held(each, DropReason::link_lost);
    any = std::exchange(each.scheduled, false) || any;
  });
  // At once for all of them: the schedule is that of the whole shard.
  if (!any) return;
  std::erase_if(scheduled_, [](const Scheduled& each) { return !each.subscription->scheduled; });
  std::make_heap(scheduled_.begin(), scheduled_.end(), is_later);
}

void Pacer::forget(Recipient& recipient) {
  if (!recipient.paced) return;
  on_away(recipient);
  recipient.outbox.set_counted_groups(nullptr);
  recipient.paced.reset();
}

void Pacer::release_due() {
  while (!ripe_.empty()) {
    // A message that is released may be lost at once, which makes others ripe.
    std::swap(ripe_, ripe_now_);
    for (PacedSubscription* each : ripe_now_) each->ripe = false;
    for (PacedSubscription* each : ripe_now_) release(*each);
    ripe_now_.clear();
  }
  while (!scheduled_.empty() && scheduled_.front().due_us <= now_us()) {
    PacedSubscription& due = *scheduled_.front().subscription;
    std::pop_heap(scheduled_.begin(), scheduled_.end(), is_later);
    scheduled_.pop_back();
    due.scheduled = false;
    release(due);
  }
}

std::uint64_t Pacer::next_due_ms() const {
  if (!ripe_.empty()) return 0;
  // Rounded up: a moment early there would be nothing to do.
  return scheduled_.empty() ? kNever : (scheduled_.front().due_us + 999) / 1000;
}

void Pacer::schedule(PacedSubscription& subscription) {
  if (subscription.scheduled || subscription.is_due(now_us())) return;
  const bool arriving = std::any_of(subscription.open().begin(), subscription.open().end(),
                                    [](const Open& open) { return open.state == State::arriving; });
  if (subscription.space() == 0 || (subscription.held() == 0 && !arriving)) return;
  subscription.scheduled = true;
  scheduled_.push_back({subscription.due_us(), &subscription});
  std::push_heap(scheduled_.begin(), scheduled_.end(), is_later);
}

void Pacer::unschedule(PacedSubscription& subscription) {
  if (!std::exchange(subscription.scheduled, false)) return;
  std::erase_if(scheduled_,
                [&](const Scheduled& each) { return each.subscription == &subscription; });
  std::make_heap(scheduled_.begin(), scheduled_.end(), is_later);
}

}  // namespace gimnet::hub
