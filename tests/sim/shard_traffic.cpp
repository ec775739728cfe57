#include <algorithm>

#include "proto/frame/flow.hpp"
#include "tests/sim/shards.hpp"

// Simulated shards read their connections and bring frames to others.

namespace gimnet::sim {

using hub::GroupMember;
using hub::GroupMembers;
using hub::NodePlace;
using proto::GoodbyeCode;
using proto::Kind;

void SimShards::has_something(Wire& wire) {
  if (dead_ || !wire.attached) return;
  Seat& seat = *shards_[wire.shard].seats[wire.slot];
  if (seat.ready) return;
  seat.ready = true;
  shards_[wire.shard].ready.push_back(wire.slot);
  want_turn(wire.shard);
}

void SimShards::serve_one(std::size_t index) {
  Shard& shard = shards_[index];
  const auto chosen = static_cast<std::size_t>(setting_.random.below(shard.ready.size()));
  const std::uint32_t slot = shard.ready[chosen];
  shard.ready[chosen] = shard.ready.back();
  shard.ready.pop_back();
  Seat* seat = shard.seats[slot].get();
  if (seat == nullptr) return;
  seat->ready = false;
  if (seat->wire && !shard.draining) read(index, *seat);
}

void SimShards::read(std::size_t index, Seat& seat) {
  const WirePointer wire = seat.wire;
  for (std::uint64_t most = setting_.random.between(1, 6); most > 0 && !wire->at_hub.empty();
       --most) {
    Bytes frame = std::move(wire->at_hub.front());
    wire->at_hub.pop_front();
    if (!handle(index, seat, std::move(frame))) return;
  }
  if (!wire->at_hub.empty()) return has_something(*wire);
  if (!wire->end_arrived) return;
  detach(seat, std::nullopt);
  tell(index, seat, false, GoodbyeCode::done, {});
}

bool SimShards::handle(std::size_t index, Seat& seat, Bytes frame) {
  const proto::FrameHeader header = proto::load_header(frame.data());
  if ((header.flags & proto::kFlagReservedMask) != 0) {
    close(index, seat, GoodbyeCode::malformed, "malformed frame");
    return false;
  }
  if (header.src != seat.node.value()) {
    close(index, seat, GoodbyeCode::wrong_source,
          "a frame's source is not this connection's node id");
    return false;
  }
  if (header.kind == Kind::link) {
    const auto goodbye =
        proto::decode<proto::Goodbye>(std::span{frame}.subspan(proto::kHeaderSize));
    require(goodbye.has_value(), Checker::seam,
            "a simulated node said a GOODBYE that cannot be read");
    detach(seat, std::nullopt);
    tell(index, seat, true, goodbye->code, goodbye->sentence);
    return false;
  }
  if (header.kind == Kind::flow) {
    on_flow(index, seat, frame);
    return true;
  }
  if (static_cast<std::uint8_t>(header.kind) >= proto::kFirstControlKind)
    return handle_control(index, seat, std::move(frame));
  route(index, frame, false);
  return true;
}

void SimShards::on_flow(std::size_t index, Seat& seat, const Bytes& frame) {
  const auto message = proto::flow::decode(std::span{frame}.subspan(proto::kHeaderSize));
  require(message.has_value(), Checker::seam,
          "a simulated node said something of FLOW that cannot be read");
  if (const auto* credit = std::get_if<proto::flow::Credit>(&*message))
    return on_credit(index, seat, *credit);
  broken(Checker::seam, "a simulated node said something of FLOW that is no CREDIT");
}

bool SimShards::handle_control(std::size_t index, Seat& seat, Bytes frame) {
  if (++seat.requests > setting_.plan.limits.requests) {
    setting_.census.add(Happening::requests_limit);
    close(index, seat, GoodbyeCode::too_many_requests, "too many requests are unanswered");
    return false;
  }
  push_event(index,
             {ShardIndex{static_cast<std::uint8_t>(index)},
              hub::ControlFrameEvent{seat.session, seat.attachment, seat.node, std::move(frame)}});
  return true;
}

void SimShards::take_mail(std::size_t index) {
  Shard& shard = shards_[index];
  take_commands(index, shard.commands.size());
  // Each sender's in order, and those of different ones in any.
  while (!shard.mail.empty()) {
    auto sender = shard.mail.begin();
    std::advance(sender, static_cast<std::ptrdiff_t>(setting_.random.below(shard.mail.size())));
    const Mail mail = std::move(sender->second.front());
    sender->second.pop_front();
    if (sender->second.empty()) shard.mail.erase(sender);
    switch (mail.kind) {
      case hub::MailKind::last:
        ++shards_[index].lasts;
        end_drain_if_all(index);
        break;
      case hub::MailKind::start_wanted:
        on_start_wanted(index, mail.start);
        break;
      case hub::MailKind::start:
        on_start(mail.start);
        break;
      case hub::MailKind::retained:
        on_handed(mail.start, mail.frame);
        break;
      default:
        route(index, mail.frame, true);
    }
  }
}

void SimShards::post(std::size_t from, std::size_t to, Mail mail) {
  shards_[to].mail[from].push_back(std::move(mail));
  want_turn(to);
}

void SimShards::route(std::size_t index, const Bytes& frame, bool handed_over) {
  const proto::FrameHeader header = proto::load_header(frame.data());
  switch (header.kind) {
    case Kind::group:
      return to_group(index, frame, handed_over);
    case Kind::service:
      return to_provider(index, frame, handed_over);
    default:
      return to_node(index, frame, index_of(NodeId{header.dst}), handed_over);
  }
}

void SimShards::to_node(std::size_t index, const Bytes& frame, std::uint32_t node,
                        bool handed_over) {
  const NodePlace place = parts_.nodes.find(node);
  if (!place.exists()) {
    setting_.census.add(Happening::unicast_to_departed);
    return;
  }
  to_place(index, frame, {place, witness_->session_of(node)}, handed_over);
}

void SimShards::to_place(std::size_t index, const Bytes& frame, const To& to, bool handed_over) {
  const std::size_t shard = to.place.shard.value();
  if (shard != index) {
    if (handed_over) return;
    setting_.census.add(Happening::unicast_across_shards);
    return post(index, shard, {.frame = frame});
  }
  Seat* seat = find(index, to.place.slot, to.place.generation);
  if (seat != nullptr) deliver(index, *seat, frame, to.session);
}

void SimShards::to_group(std::size_t index, const Bytes& frame, bool handed_over) {
  const proto::FrameHeader header = proto::load_header(frame.data());
  const std::uint32_t group = index_of(GroupId{header.dst});
  const GroupMembers* members = parts_.groups.find(group);
  if (members == nullptr) return;
  const bool from_provider = members->provider.value() == header.src;
  if (!from_provider && (members->provided() || !handed_over))
    return setting_.census.add(Happening::group_of_another);
  if (!from_provider) setting_.census.add(Happening::group_of_nobody);
  require(!from_provider || witness_->provides(index_of(NodeId{header.src}), group),
          Checker::group_table, "a node sends to a group that is not of a service of its own");
  members->by_shard[index].for_each([&](const GroupMember& member) {
    Seat* seat = find(index, member.slot, member.generation);
    if (seat == nullptr) return;
    require_subscribed(*seat, group);
    deliver(index, *seat, frame, witness_->session_of(index_of(seat->node)));
  });
  const bool paced = !members->paced_by_shard.empty();
  if (paced) to_paced(index, frame, members->paced_by_shard[index]);
  if (handed_over) return;
  for (std::size_t other = 0; other < shards_.size(); ++other) {
    const bool any =
        !members->by_shard[other].empty() || (paced && !members->paced_by_shard[other].empty());
    if (other != index && any) post(index, other, {.frame = frame});
  }
  if (members->retain) keep_last(index, frame);
  if (const std::uint64_t stream = witness_->retained_stream(group))
    last_[group] = {stream, message_of(frame)};
}

void SimShards::to_paced(std::size_t index, const Bytes& frame,
                         const hub::MemberList<hub::PacedMember>& members) {
  const GroupId group{proto::load_header(frame.data()).dst};
  members.for_each([&](const hub::PacedMember& member) {
    Seat* seat = find(index, member.slot, member.generation);
    if (seat == nullptr) return;
    require_subscribed(*seat, index_of(group));
    const std::uint64_t session = witness_->session_of(index_of(seat->node));
    Pace* pace = find_pace(*seat, group);
    if (pace != nullptr) {
      static_cast<void>(offer(index, *seat, *pace, {frame, session}));
    } else if (member.was_plain) {
      deliver(index, *seat, frame, session);
    }
  });
}

void SimShards::require_subscribed(const Seat& seat, std::uint32_t group) const {
  require(witness_->subscribes(index_of(seat.node), group), Checker::right_session,
          "a frame of a service goes to a node that has not subscribed to it");
}

void SimShards::to_provider(std::size_t index, const Bytes& frame, bool handed_over) {
  const GroupMembers* members =
      parts_.groups.find(index_of(GroupId{proto::load_header(frame.data()).dst}));
  if (members == nullptr || !members->provided()) return;
  if (!members->accepts) return setting_.census.add(Happening::service_frame_refused);
  to_place(index, frame,
           {members->provider_place, witness_->session_of(index_of(members->provider))},
           handed_over);
}

void SimShards::deliver(std::size_t index, Seat& seat, const Bytes& frame,
                        std::uint64_t for_session) {
  require_for(seat, for_session);
  if (!seat.wire && !seat.waits_when_away) {
    setting_.census.add(Happening::unicast_dropped_away);
    return;
  }
  push(index, seat, {frame, for_session});
}

void SimShards::require_for(const Seat& seat, std::uint64_t session) {
  require(session != 0, Checker::right_session,
          "a frame for a node that is not there waits for another one");
  require(seat.number == session, Checker::right_session,
          "a frame waits for another session than the one it is for");
}

void SimShards::push(std::size_t index, Seat& seat, Data data) {
  const std::vector<GroupId> lost = make_room(seat, proto::load_header(data.frame.data()));
  seat.data.push_back(std::move(data));
  want_flush(index, seat);
  for (const GroupId group : lost) {
    Pace* pace = find_pace(seat, group);
    if (pace == nullptr) continue;
    pace->counts.on_lost(1);
    setting_.census.add(Happening::paced_message_lost);
    release_held(index, seat, *pace);
  }
}

/// Drops messages in favour of a newcomer: an older LATEST message of the same stream, also if the
/// queue is not full, or the oldest one of a service at a full queue. Returns their groups.
std::vector<GroupId> SimShards::make_room(Seat& seat, const proto::FrameHeader& header) {
  std::vector<GroupId> lost;
  if (header.kind != Kind::group) return lost;
  std::size_t groups = 0;
  for (auto entry = seat.data.begin(); entry != seat.data.end();) {
    const proto::FrameHeader waiting = proto::load_header(entry->frame.data());
    const bool same =
        waiting.kind == header.kind && waiting.dst == header.dst && waiting.src == header.src;
    if (same && header.policy() == proto::Policy::latest &&
        waiting.policy() == proto::Policy::latest) {
      setting_.census.add(Happening::latest_replaced);
      lost.push_back(GroupId{waiting.dst});
      entry = seat.data.erase(entry);
      continue;
    }
    groups += waiting.kind == Kind::group ? 1 : 0;
    ++entry;
  }
  if (groups < setting_.plan.queue_messages) return lost;
  const auto oldest = std::find_if(seat.data.begin(), seat.data.end(), [](const Data& each) {
    return proto::load_header(each.frame.data()).kind == Kind::group;
  });
  setting_.census.add(Happening::oldest_dropped);
  lost.push_back(GroupId{proto::load_header(oldest->frame.data()).dst});
  seat.data.erase(oldest);
  return lost;
}

void SimShards::want_flush(std::size_t index, Seat& seat) {
  if (seat.flush_due || !seat.wire) return;
  if (seat.control.empty() && seat.data.empty()) return;
  seat.flush_due = true;
  Time delay{setting_.random.between(1, 300)};
  if (parts_.is_slow(seat.wire->node)) {
    setting_.census.add(Happening::slow_reader);
    delay = Time{setting_.random.between(1'000, 300'000)};
  }
  setting_.agenda.after(delay, [this, index, session = seat.session] {
    Seat* found = dead_ ? nullptr : find(index, session.slot, session.generation);
    if (found == nullptr) return;
    found->flush_due = false;
    flush(index, *found);
  });
}

void SimShards::flush(std::size_t index, Seat& seat) {
  if (!seat.wire) return;
  for (; !seat.control.empty(); seat.control.pop_front()) {
    setting_.trace.mix(seat.control.front());
    parts_.network.to_node(seat.wire, std::move(seat.control.front()));
  }
  ask_to_be_told(index, seat);
  for (; !seat.data.empty(); seat.data.pop_front()) {
    require(seat.data.front().for_session == seat.wire->session, Checker::right_session,
            "a frame leaves on a connection of another session");
    setting_.trace.note("shard {a} hands a frame to wire {b}", index, seat.wire->number);
    parts_.network.to_node(seat.wire, std::move(seat.data.front().frame));
  }
}

}  // namespace gimnet::sim
