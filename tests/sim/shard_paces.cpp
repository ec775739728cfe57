#include <algorithm>

#include "proto/frame/flow.hpp"
#include "tests/sim/shards.hpp"

// Simulated shards pace subscriptions and keep last messages, as hub/data/fanout/pacer.cpp and
// retained_messages.cpp do, for messages of one frame each.

namespace gimnet::sim {

namespace {

std::uint64_t in_us(Time time) { return static_cast<std::uint64_t>(time.count()); }

}  // namespace

SimShards::Pace* SimShards::find_pace(const Seat& seat, GroupId group) {
  const auto found = seat.paces.find(group.value());
  return found == seat.paces.end() ? nullptr : found->second.get();
}

void SimShards::begin_pace(std::size_t index, const hub::PaceCommand& command) {
  Seat* seat = find(index, command.session.slot, command.session.generation);
  require(seat != nullptr, Checker::seam,
          "a subscription is paced of a session that the shard does not know");
  setting_.trace.note("shard {a} paces group {b} by a window of {c}", index,
                      index_of(command.group), command.terms.window);
  const bool misses = seat->wire && seat->events != hub::EventState::told;
  if (misses && command.with_event && find_pace(*seat, command.group) == nullptr) return;
  std::unique_ptr<Pace>& pace = seat->paces[command.group.value()];
  const bool begins = pace == nullptr;
  if (begins) {
    pace = std::make_unique<Pace>(nobody_, command.group, command.terms);
    begin_counts(*seat, *pace, command.number);
  }
  if (!(pace->counts.terms() == command.terms)) {
    pace->counts.set_terms(command.terms);
    pace->begun = 0;
  }
  release_held(index, *seat, *pace);
  while (pace->held.size() > pace->counts.terms().depth) pace->held.pop_front();
  pace->counts.retained = command.retained;
  if (begins && command.retained) ask_start(index, *seat, *pace);
}

void SimShards::end_pace(std::size_t index, const hub::EndPaceCommand& command) {
  Seat* seat = find(index, command.session.slot, command.session.generation);
  if (seat != nullptr) seat->paces.erase(command.group.value());
}

/// With what is written from now on.
void SimShards::begin_counts(Seat& seat, Pace& pace, std::uint8_t number) {
  const auto waiting = std::count_if(seat.data.begin(), seat.data.end(), [&](const Data& each) {
    const proto::FrameHeader header = proto::load_header(each.frame.data());
    return header.kind == proto::Kind::group && header.dst == pace.counts.group().value();
  });
  pace.counts.begin_counts(number, static_cast<std::uint64_t>(waiting));
}

bool SimShards::offer(std::size_t index, Seat& seat, Pace& pace, Data data) {
  if (pace.counts.awaits_start) return false;
  require_for(seat, data.for_session);
  if (!seat.wire && !seat.waits_when_away) {
    setting_.census.add(Happening::paced_message_missed);
  } else if (pace.held.empty() && pace.counts.may_begin(in_us(setting_.agenda.now()))) {
    pass(index, seat, pace, std::move(data));
  } else {
    hold(pace, std::move(data));
    release_held(index, seat, pace);
  }
  return true;
}

void SimShards::hold(Pace& pace, Data data) {
  setting_.census.add(pace.counts.space() == 0 ? Happening::window_full : Happening::not_due);
  while (pace.held.size() >= pace.counts.terms().depth) {
    setting_.census.add(Happening::held_replaced);
    pace.held.pop_front();
  }
  pace.held.push_back(std::move(data));
}

void SimShards::pass(std::size_t index, Seat& seat, Pace& pace, Data data) {
  const Time now = setting_.agenda.now();
  const std::uint64_t interval = pace.counts.terms().interval_us;
  if (pace.begun++ == 0) pace.first = now;
  // One may be late, and the next one in time all the same.
  require(pace.begun < 3 || (pace.begun - 2) * interval <= in_us(now - pace.first), Checker::pace,
          "a subscriber gets more messages than its maximal rate allows");
  pace.last = now;
  pace.counts.on_begun(in_us(now));
  pace.counts.on_sent(1);
  push(index, seat, std::move(data));
}

void SimShards::release_held(std::size_t index, Seat& seat, Pace& pace) {
  while (!pace.held.empty() && pace.counts.may_begin(in_us(setting_.agenda.now()))) {
    // With a time between two, what is not the newest would only be older by then.
    while (pace.counts.terms().interval_us != 0 && pace.held.size() > 1) pace.held.pop_front();
    Data data = std::move(pace.held.front());
    pace.held.pop_front();
    pass(index, seat, pace, std::move(data));
  }
  wait_until_due(index, seat, pace);
}

/// By the terms alone: one interval behind the message before, at once without one.
Time SimShards::latest_due(const Pace& pace) {
  const Time interval{static_cast<std::int64_t>(pace.counts.terms().interval_us)};
  return pace.last && interval != Time{} ? *pace.last + interval : Time{};
}

void SimShards::wait_until_due(std::size_t index, Seat& seat, Pace& pace) {
  if (pace.held.empty() || pace.counts.space() == 0) return;
  const Time now = setting_.agenda.now();
  require(now < latest_due(pace), Checker::pace,
          "a subscriber waits longer for a message than its maximal rate demands");
  const Time due =
      std::min(latest_due(pace), Time{static_cast<std::int64_t>(pace.counts.due_us())});
  if (pace.wakes && *pace.wakes <= due) return;
  pace.wakes = due;
  setting_.agenda.at(due, [this, index, due, session = seat.session, group = pace.counts.group()] {
    Seat* found = dead_ ? nullptr : find(index, session.slot, session.generation);
    Pace* waiting = found == nullptr ? nullptr : find_pace(*found, group);
    if (waiting == nullptr) return;
    if (waiting->wakes == due) waiting->wakes.reset();
    release_held(index, *found, *waiting);
  });
}

void SimShards::on_credit(std::size_t index, Seat& seat, const proto::flow::Credit& credit) {
  Pace* pace = find_pace(seat, credit.group);
  if (pace == nullptr || pace->counts.number() != credit.number)
    return setting_.census.add(Happening::credit_too_late);
  require(pace->counts.on_credit(credit.taken), Checker::credit,
          "hub and subscriber count the messages of a service differently");
  setting_.census.add(Happening::credited);
  release_held(index, seat, *pace);
}

void SimShards::count_anew(std::size_t index, Seat& seat) {
  for (auto& [group, pace] : seat.paces) {
    setting_.census.add(Happening::counted_anew);
    begin_counts(seat, *pace, pace->counts.number());
    const bool has_newer = !pace->held.empty() || pace->counts.uncredited() != 0;
    release_held(index, seat, *pace);
    if (pace->counts.retained && !has_newer) ask_start(index, seat, *pace);
  }
}

// ---- last messages

void SimShards::keep_last(std::size_t index, const Bytes& frame) {
  const proto::FrameHeader header = proto::load_header(frame.data());
  shards_[index].kept[header.dst] = {NodeId{header.src}, frame};
}

void SimShards::ask_start(std::size_t index, const Seat& seat, Pace& pace) {
  const GroupId group = pace.counts.group();
  const hub::GroupMembers* members = parts_.groups.find(index_of(group));
  pace.counts.start_ticket = ++starts_;
  pace.counts.awaits_start = members != nullptr && members->provided();
  if (!pace.counts.awaits_start) return;
  const ShardIndex self{static_cast<std::uint8_t>(index)};
  const hub::GroupStart start{
      group, seat.session.slot, seat.session.generation, pace.counts.start_ticket,
      self,  members->provider};
  const std::size_t provider = members->provider_place.shard.value();
  if (provider == index) return on_start_wanted(index, start);
  setting_.census.add(Happening::start_across_shards);
  post(index, provider, {.kind = hub::MailKind::start_wanted, .frame = {}, .start = start});
}

bool SimShards::is_of_another(const hub::GroupStart& start) const {
  const hub::GroupMembers* members = parts_.groups.find(index_of(start.group));
  return members != nullptr && members->provided() && members->provider != start.provider;
}

void SimShards::on_start_wanted(std::size_t index, const hub::GroupStart& start) {
  const auto found = shards_[index].kept.find(start.group.value());
  const Kept* kept = found == shards_[index].kept.end() ? nullptr : &found->second;
  require_last(start, kept);
  const std::size_t to = start.shard.value();
  if (to == index) {
    on_start(start);
    if (kept != nullptr) on_handed(start, Bytes{kept->frame});
    return;
  }
  post(index, to, {.kind = hub::MailKind::start, .frame = {}, .start = start});
  if (kept != nullptr)
    post(index, to, {.kind = hub::MailKind::retained, .frame = kept->frame, .start = start});
}

void SimShards::require_last(const hub::GroupStart& start, const Kept* kept) const {
  const std::uint64_t stream = witness_->retained_stream(index_of(start.group));
  if (stream == 0 || is_of_another(start)) return;  // it ended while this was under way
  const auto last = last_.find(index_of(start.group));
  const bool any = last != last_.end() && last->second.stream == stream;
  require(any == (kept != nullptr), Checker::retained,
          any ? "the last message of a retained service is not kept"
              : "what is kept is not of this service");
  require(!any || message_of(kept->frame) == last->second.message, Checker::retained,
          "what is kept is not the last message of a retained service");
}

/// nullptr: it has asked for a later start since, or ended.
SimShards::Pace* SimShards::pace_of(const hub::GroupStart& start) {
  const Seat* seat = find(start.shard.value(), start.slot, start.generation);
  Pace* pace = seat == nullptr ? nullptr : find_pace(*seat, start.group);
  return pace != nullptr && pace->counts.start_ticket == start.ticket ? pace : nullptr;
}

void SimShards::on_start(const hub::GroupStart& start) {
  Pace* pace = pace_of(start);
  if (pace == nullptr) return;
  if (is_of_another(start)) {
    const std::size_t shard = start.shard.value();
    return ask_start(shard, *find(shard, start.slot, start.generation), *pace);
  }
  pace->counts.awaits_start = false;
}

void SimShards::on_handed(const hub::GroupStart& start, const Bytes& frame) {
  Pace* pace = pace_of(start);
  if (pace == nullptr || is_of_another(start)) return;
  setting_.census.add(Happening::last_message_first);
  Seat& seat = *find(start.shard.value(), start.slot, start.generation);
  static_cast<void>(offer(start.shard.value(), seat, *pace, {frame, seat.number}));
}

// ---- at the end

void SimShards::require_at_rest() const {
  for (const Shard& shard : shards_) {
    for (const std::unique_ptr<Seat>& seat : shard.seats) {
      if (seat == nullptr) continue;
      for (const auto& [group, pace] : seat->paces) {
        require(pace->held.empty(), Checker::credit, "a message is held for ever");
        require(pace->counts.terms().window == 0 || pace->counts.uncredited() == 0, Checker::credit,
                "a window is narrower than it ought to be, and all was credited");
      }
    }
    for (const auto& [group, kept] : shard.kept) {
      require(witness_->retained_stream(index_of(GroupId{group})) != 0, Checker::retained,
              "the last message of a service that is gone is kept");
    }
  }
}

}  // namespace gimnet::sim
