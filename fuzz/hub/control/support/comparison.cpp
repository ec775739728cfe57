#include <algorithm>

#include "fuzz/hub/control/support/reference.hpp"
#include "fuzz/support/fuzz_input.hpp"

// What a step of the hub did beside its answer, against the reference.

namespace gimnet::fuzz {

namespace ns = proto::ns;

namespace {

/// Two lists with the same in them, in whatever order.
template <class List>
bool same_set(List a, List b) {
  std::sort(a.begin(), a.end());
  std::sort(b.begin(), b.end());
  return a == b;
}

Seat seat_of(std::uint8_t shard, const hub::SessionRef& ref) {
  return {shard, ref.slot.value(), ref.generation};
}

/// Of each member: where it is, and whether it got everything before it was paced.
using Members = std::vector<std::pair<Seat, bool>>;

template <class Member>
Members members_of(const std::vector<hub::MemberList<Member>>& by_shard) {
  Members members;
  for (std::size_t shard = 0; shard < by_shard.size(); ++shard) {
    by_shard[shard].for_each([&](const Member& member) {
      bool was_plain = false;
      if constexpr (requires { member.was_plain; }) was_plain = member.was_plain;
      members.emplace_back(
          Seat{static_cast<std::uint8_t>(shard), member.slot.value(), member.generation},
          was_plain);
    });
  }
  return members;
}

/// The change of a note in the journal, as one that watches reads it.
ns::Change change_of(const hub::Journal::Note& note) {
  proto::bitestream::Writer writer;
  ns::WatchEvents head;
  head.watch = 1;
  head.write_head(writer);
  proto::Payload payload =
      proto::assemble_control({ns::WatchEvents::kOperation, proto::kNoRequest}, writer);
  payload.insert(payload.begin() + proto::kControlHeaderSize, note.bytes.begin(), note.bytes.end());
  const auto events = proto::decode<ns::WatchEvents>(payload);
  FUZZ_MUST(events && events->changes.size() == 1);
  return events->changes.front();
}

}  // namespace

void Reference::compare(const ControlHub& hub) {
  compare_sessions(hub);
  compare_tables(hub);
  compare_events(hub);
  compare_notes(hub);
  compare_commands(hub);
  compare_paces(hub);
  compare_deadline(hub);
  FUZZ_MUST(hub.conductor.drain_wanted() == drain_wanted_);
  due_.clear();
  counts_.clear();
  notes_.clear();
  released_.clear();
  closed_.clear();
  renumbered_.clear();
  dropped_.clear();
  reloaded_ = false;
}

void Reference::compare_sessions(const ControlHub& hub) const {
  const hub::Membership& membership = hub.conductor.membership();
  const auto& all = membership.sessions().all();
  FUZZ_MUST(all.size() == by_index_.size() && membership.directory().size() == names_.size());
  auto actual = all.begin();
  for (const auto& [index, id] : by_index_) {
    const Session& session = sessions_.at(id);
    FUZZ_MUST(actual->first == index && actual->second.name == session.name);
    FUZZ_MUST(actual->second.connected == session.connected);
    if (!session.name.empty()) FUZZ_MUST(membership.directory().find(session.name) == index);
    ++actual;
  }
}

void Reference::compare_tables(const ControlHub& hub) const {
  for (const std::uint32_t index : nodes_given_) {
    const hub::NodePlace place = hub.nodes.find(index);
    const auto found = by_index_.find(index);
    FUZZ_MUST(place.exists() == (found != by_index_.end()));
    FUZZ_MUST(place.is_renumbered() == (found == by_index_.end() && moved_.contains(index)));
    if (found == by_index_.end()) continue;
    FUZZ_MUST((Seat{place.shard.value(), place.slot.value(), place.generation} ==
               sessions_.at(found->second).seat));
  }
  for (const std::uint32_t index : groups_given_) {
    const hub::GroupMembers* members = hub.groups.find(index);
    const auto found = groups_.find(index);
    FUZZ_MUST((members != nullptr) == (found != groups_.end()));
    if (members != nullptr) compare_group(*members, topics_.at(found->second));
  }
}

void Reference::compare_group(const hub::GroupMembers& members, const Topic& topic) const {
  const Service& service = *topic.service;
  const Session& provider = sessions_.at(service.provider);
  FUZZ_MUST(members.provider == id_of(provider.index));
  const hub::NodePlace& place = members.provider_place;
  FUZZ_MUST((Seat{place.shard.value(), place.slot.value(), place.generation} == provider.seat));
  FUZZ_MUST(members.retain == service.terms.retain);
  FUZZ_MUST(members.accepts == (service.terms.direction == ns::Direction::accepts));
  Members plain;
  Members paced;
  for (const auto& [subscriber, terms] : topic.subscribers) {
    const Seat& seat = sessions_.at(subscriber).seat;
    (pace_of(topic, subscriber) ? paced : plain)
        .emplace_back(seat, topic.once_plain.contains(subscriber));
  }
  FUZZ_MUST(same_set(members_of(members.by_shard), plain) &&
            same_set(members_of(members.paced_by_shard), paced));
}

void Reference::compare_events(const ControlHub& hub) {
  std::vector<Event> told;
  std::vector<Count> counts;
  const auto take = [&](std::uint64_t to, std::uint16_t operation, const auto& event) {
    told.emplace_back(to, operation, std::string{}, index_of(event.group), 0, index_of(event.node));
    counts.emplace_back(to, index_of(event.group), event.subscribers);
  };
  for (const auto& [shard, command] : hub.all<hub::SendControlCommand>()) {
    if (command->answers != 0) continue;
    const auto payload = payload_of(*command);
    const std::uint16_t operation = proto::split_control(payload)->header.operation;
    const std::uint64_t to = session_at(seat_of(shard, command->session));
    FUZZ_MUST(to != 0 && command->attachment == 0);
    if (const auto moved = proto::decode<ns::ServiceMoved>(payload)) {
      told.emplace_back(to, operation,
                        std::string(reinterpret_cast<const char*>(payload.data()), payload.size()),
                        index_of(moved->old_group), index_of(moved->new_group), 0);
    } else if (const auto joined = proto::decode<ns::SubscriberJoined>(payload)) {
      take(to, operation, *joined);
    } else if (const auto left = proto::decode<ns::SubscriberLeft>(payload)) {
      take(to, operation, *left);
    } else {
      FUZZ_MUST(operation == ns::WatchEvents::kOperation);  // served() looks at those
    }
  }
  // Who is not connected learns what is true when it declares again.
  const auto gone = [this](const auto& event) {
    const auto found = sessions_.find(std::get<0>(event));
    return found == sessions_.end() || !found->second.connected;
  };
  std::erase_if(due_, gone);
  std::erase_if(counts_, gone);
  FUZZ_MUST(same_set(told, due_));
  FUZZ_MUST(same_set(counts, counts_));
}

void Reference::compare_notes(const ControlHub& hub) {
  const hub::Journal& journal = hub.conductor.watches().journal();
  FUZZ_MUST(journal.version() - version_ == notes_.size());
  // A step may leave more than the journal keeps.
  std::vector<Note> told;
  while (version_ < journal.version()) {
    if (!journal.reaches(version_)) {
      version_ = journal.version();
      return;
    }
    const ns::Change change = change_of(journal.at(++version_));
    FUZZ_MUST(change.version == version_);
    const bool service = change.service.has_value();
    const std::uint32_t index =
        service ? index_of(change.service->group) : index_of(change.node->node);
    const std::string& name = service ? change.service->name : change.node->name;
    told.emplace_back(static_cast<std::uint8_t>(change.kind), service, index, name,
                      change.former_name);
  }
  FUZZ_MUST(same_set(told, notes_));
}

void Reference::compare_commands(const ControlHub& hub) {
  std::vector<Seat> released;
  for (const auto& [shard, command] : hub.all<hub::ReleaseCommand>()) {
    released.push_back(seat_of(shard, command->session));
  }
  FUZZ_MUST(same_set(released, released_));
  std::map<Seat, proto::GoodbyeCode> closed;
  for (const auto& [shard, command] : hub.all<hub::CloseCommand>()) {
    FUZZ_MUST(!command->sentence.empty());
    FUZZ_MUST(closed.emplace(seat_of(shard, command->session), command->code).second);
  }
  FUZZ_MUST(closed == closed_);
  std::vector<std::pair<Seat, std::uint32_t>> renumbered;
  for (const auto& [shard, command] : hub.all<hub::RenumberCommand>()) {
    FUZZ_MUST(!command->sentence.empty());
    renumbered.emplace_back(seat_of(shard, command->session), index_of(command->node));
  }
  FUZZ_MUST(renumbered == renumbered_);
  const auto limits = hub.all<hub::LimitsCommand>();
  FUZZ_MUST(limits.size() == (reloaded_ ? ControlHub::kShards : 0));
  for (const auto& [shard, command] : limits) {
    for (const hub::LimitInfo& limit : hub::limit_table()) {
      FUZZ_MUST(command->limits.*limit.field == limits_.*limit.field);
    }
  }
  for (const hub::LimitInfo& limit : hub::limit_table())
    FUZZ_MUST(hub.limits.*limit.field == limits_.*limit.field);
}

/// What the shards were told of pace is what there is.
void Reference::compare_paces(const ControlHub& hub) {
  std::vector<std::uint32_t> dropped;
  for (const hub::FakeShards::Sent& sent : hub.shards.sent) {
    const std::uint8_t shard = sent.shard.value();
    if (const auto* pace = std::get_if<hub::PaceCommand>(&sent.command)) {
      const Terms terms{pace->terms.window, pace->terms.depth, pace->terms.interval_us};
      paces_[{seat_of(shard, pace->session), index_of(pace->group)}] = {terms, pace->retained};
    } else if (const auto* end = std::get_if<hub::EndPaceCommand>(&sent.command)) {
      FUZZ_MUST(paces_.erase({seat_of(shard, end->session), index_of(end->group)}) == 1);
    } else if (const auto* release = std::get_if<hub::ReleaseCommand>(&sent.command)) {
      const Seat seat = seat_of(shard, release->session);
      std::erase_if(paces_, [&seat](const auto& entry) { return entry.first.first == seat; });
    } else if (const auto* forget = std::get_if<hub::ForgetRetainedCommand>(&sent.command)) {
      dropped.push_back(index_of(forget->group));
    }
  }
  std::map<std::pair<Seat, std::uint32_t>, std::pair<Terms, bool>> due;
  for (const auto& [group, full_name] : groups_) {
    const Topic& topic = topics_.at(full_name);
    for (const auto& [subscriber, asked] : topic.subscribers) {
      const auto pace = pace_of(topic, subscriber);
      if (pace) due[{sessions_.at(subscriber).seat, group}] = {*pace, topic.service->terms.retain};
    }
  }
  FUZZ_MUST(paces_ == due);
  std::vector<std::uint32_t> gone;
  for (const auto& [group, provider] : dropped_) {
    if (sessions_.contains(provider)) gone.push_back(group);
  }
  FUZZ_MUST(same_set(dropped, gone));
}

void Reference::compare_deadline(const ControlHub& hub) const {
  const std::optional<milliseconds> next = hub.conductor.next_deadline();
  const auto reached = [&](milliseconds due) { return next.has_value() && *next <= due; };
  for (const auto& [id, session] : sessions_) {
    if (!session.connected) FUZZ_MUST(reached(session.away_until));
    if (session.connected && session.declare_until) FUZZ_MUST(reached(*session.declare_until));
  }
}

}  // namespace gimnet::fuzz
