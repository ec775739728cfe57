#include "tests/sim/shards.hpp"

#include <algorithm>

#include "base/endian.hpp"
#include "hub/shard/control_frame.hpp"
#include "proto/frame/flow.hpp"

namespace gimnet::sim {

using hub::AttachCommand;
using hub::ShardCommand;
using proto::GoodbyeCode;
using namespace std::chrono_literals;

Bytes frame_of(proto::FrameHeader header, std::span<const std::byte> payload) {
  header.length = static_cast<std::uint32_t>(payload.size());
  Bytes frame(header.frame_size());
  proto::store_header(frame.data(), header);
  std::copy(payload.begin(), payload.end(), frame.begin() + proto::kHeaderSize);
  return frame;
}

Bytes link_frame(NodeId to, HubId hub, const proto::Payload& payload) {
  proto::FrameHeader header;
  header.kind = proto::Kind::link;
  header.dst = to.value();
  header.src = make_id<NodeId>(hub, kHubIndex).value();
  return frame_of(header, payload);
}

std::vector<Bytes> split_frames(std::span<const std::byte> bytes) {
  std::vector<Bytes> frames;
  while (!bytes.empty()) {
    const std::size_t size = proto::load_header(bytes.data()).frame_size();
    frames.emplace_back(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
    bytes = bytes.subspan(size);
  }
  return frames;
}

std::uint64_t message_of(const Bytes& frame) {
  return load_le<std::uint64_t>(frame.data() + proto::kHeaderSize);
}

SimShards::SimShards(Setting& setting, Parts parts)
    : setting_(setting), parts_(std::move(parts)), shards_(parts_.shards) {}

void SimShards::send(ShardIndex index, ShardCommand command) {
  if (auto* tell = std::get_if<hub::TellCommand>(&command)) {
    for (const hub::TellCommand::To& to : tell->to) {
      hub::set_destination(tell->frame, to.node);
      send(index, hub::SendControlCommand{to.session, 0, tell->frame, 0, {}, true});
    }
    return;
  }
  parts_.before_it_leaves(index, command);
  Shard& shard = shards_[index.value()];
  shard.commands.push_back(std::move(command));
  sent_.push_back({index, &shard.commands.back()});
  want_turn(index.value());
}

std::vector<std::size_t> SimShards::with_events() const {
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < shards_.size(); ++i) {
    if (!shards_[i].events.empty()) found.push_back(i);
  }
  return found;
}

hub::ShardEvent SimShards::take_event(std::size_t index) {
  std::deque<hub::ShardEvent>& events = shards_[index].events;
  hub::ShardEvent event = std::move(events.front());
  events.pop_front();
  return event;
}

void SimShards::push_event(std::size_t shard, hub::ShardEvent event) {
  shards_[shard].events.push_back(std::move(event));
  parts_.conductor_wanted();
}

void SimShards::want_turn(std::size_t index) {
  if (shards_[index].turn_due) return;
  shards_[index].turn_due = true;
  Time delay{setting_.random.between(1, 400)};
  if (setting_.random.chance(setting_.plan.shard_pause) &&
      setting_.agenda.now() < setting_.plan.faults_until) {
    delay = Time{setting_.random.between(20'000, 600'000)};
    setting_.census.add(Happening::shard_paused);
    setting_.trace.note("shard {a} pauses for {b} us", index,
                        static_cast<std::uint64_t>(delay.count()));
  }
  setting_.agenda.after(delay, [this, index] {
    shards_[index].turn_due = false;
    if (!dead_) turn(index);
  });
}

void SimShards::turn(std::size_t index) {
  Shard& shard = shards_[index];
  parts_.quiescence.enter(index);
  // Any of the things that a real turn does, so that the conductor comes between any two of them.
  const std::uint64_t choice = setting_.random.below(3);
  if (choice == 0 && !shard.commands.empty()) {
    const std::uint64_t most = setting_.random.between(1, 8);
    take_commands(index, static_cast<std::size_t>(most));
  } else if (choice == 1 && !shard.mail.empty()) {
    take_mail(index);
  } else if (!shard.ready.empty()) {
    serve_one(index);
  } else {
    take_commands(index, shard.commands.size());
    take_mail(index);
  }
  if (!shard.commands.empty() || !shard.mail.empty() || !shard.ready.empty())
    return want_turn(index);
  parts_.quiescence.leave(index);
}

void SimShards::take_commands(std::size_t index, std::size_t most) {
  std::deque<ShardCommand>& commands = shards_[index].commands;
  for (; most > 0 && !commands.empty(); --most) {
    ShardCommand command = std::move(commands.front());
    commands.pop_front();
    execute(index, command);
  }
}

void SimShards::execute(std::size_t index, ShardCommand& command) {
  if (auto* attached = std::get_if<AttachCommand>(&command)) {
    attach(index, *attached);
  } else if (const auto* control = std::get_if<hub::SendControlCommand>(&command)) {
    say(index, *control);
  } else if (const auto* again = std::get_if<hub::TellAgainCommand>(&command)) {
    tell_again(index, *again);
  } else if (const auto* closing = std::get_if<hub::CloseCommand>(&command)) {
    Seat* seat = find(index, closing->session.slot, closing->session.generation);
    if (seat != nullptr && seat->wire)
      close(index, *seat, closing->code, closing->sentence.c_str());
  } else if (const auto* renumbered = std::get_if<hub::RenumberCommand>(&command)) {
    Seat* seat = find(index, renumbered->session.slot, renumbered->session.generation);
    require(seat != nullptr, Checker::seam,
            "a session gets another id that the shard does not know");
    rename_source(index, seat->node, renumbered->node);
    if (seat->wire) close(index, *seat, GoodbyeCode::renumbered, renumbered->sentence.c_str());
    lose_data(*seat);
    seat->node = renumbered->node;
  } else if (const auto* released = std::get_if<hub::ReleaseCommand>(&command)) {
    release(index, released->session);
  } else if (const auto* pace = std::get_if<hub::PaceCommand>(&command)) {
    begin_pace(index, *pace);
  } else if (const auto* ended = std::get_if<hub::EndPaceCommand>(&command)) {
    end_pace(index, *ended);
  } else if (const auto* forget = std::get_if<hub::ForgetRetainedCommand>(&command)) {
    const auto kept = shards_[index].kept.find(forget->group.value());
    if (kept != shards_[index].kept.end() && kept->second.provider == forget->provider)
      shards_[index].kept.erase(kept);
  } else if (std::holds_alternative<hub::DrainCommand>(command)) {
    drain(index);
  } else if (std::holds_alternative<hub::StopCommand>(command)) {
    broken(Checker::seam, "a shard is told to stop by the conductor");
  }
}

SimShards::Seat& SimShards::seat_for(std::size_t index, const AttachCommand& command) {
  Shard& shard = shards_[index];
  const std::size_t slot = command.session.slot.value();
  if (slot >= shard.seats.size()) {
    shard.seats.resize(slot + 1);
    shard.used.resize(slot + 1);
  }
  std::unique_ptr<Seat>& seat = shard.seats[slot];
  if (seat != nullptr && seat->session.generation != command.session.generation) {
    broken(Checker::seam,
           "a connection comes to a slot that an earlier session was not released from");
  }
  require((seat == nullptr) == command.new_session, Checker::seam,
          "a connection for a new session comes to one that is there, or for an old one to one "
          "that is not");
  if (seat == nullptr) {
    if (shard.used[slot]) setting_.census.add(Happening::slot_reused);
    shard.used[slot] = true;
    seat = std::make_unique<Seat>();
    seat->session = command.session;
    seat->node = command.node;
  }
  require(seat->node == command.node, Checker::seam,
          "a session's connection comes for another node");
  require(command.attachment == seat->attachment + 1, Checker::seam,
          "a session's connections are not counted by ones");
  return *seat;
}

void SimShards::attach(std::size_t index, AttachCommand& command) {
  const WirePointer wire = static_cast<const WireStream&>(*command.transport).wire();
  Seat& seat = seat_for(index, command);
  setting_.trace.note("shard {a} attaches wire {b} as node {c}", index, wire->number,
                      index_of(command.node));
  if (seat.wire) {
    detach(seat, proto::Goodbye{GoodbyeCode::replaced, "a newer connection took its place"});
  } else if (!seat.data.empty()) {
    setting_.census.add(Happening::unicast_waited_for_return);
  }
  seat.number = wire->session;
  seat.attachment = command.attachment;
  seat.wire = wire;
  seat.events = hub::EventState::told;
  seat.waits_when_away = command.resume_wanted;
  wire->attached = true;
  wire->shard = index;
  wire->slot = command.session.slot.value();
  parts_.network.to_node(wire,
                         link_frame(command.node, parts_.hub, proto::encode(command.welcome)));
  for (Bytes& frame : split_frames(command.told)) seat.control.push_back(std::move(frame));
  if (!command.told.empty()) setting_.census.add(Happening::moves_told_again);
  count_anew(index, seat);
  if (!wire->at_hub.empty() || wire->end_arrived) has_something(*wire);
  if (!wire->node_open) setting_.census.add(Happening::hello_of_the_dead);
  if (!wire->node_open && !wire->end_arrived) set_mute(wire, true);
  want_flush(index, seat);
}

void SimShards::say(std::size_t index, const hub::SendControlCommand& command) {
  Seat* seat = find(index, command.session.slot, command.session.generation);
  if (seat == nullptr || !seat->wire) return;
  if (command.attachment != 0 && command.attachment != seat->attachment) return;
  require(seat->requests >= command.answers, Checker::answers,
          "more answers than requests on a connection");
  seat->requests -= command.answers;
  if (command.may_drop && misses(*seat)) return ask_to_be_told(index, *seat);
  Pace* begun = command.counts ? find_pace(*seat, command.counts->group) : nullptr;
  seat->control.push_back(command.frame);
  if (begun != nullptr) {
    begin_counts(*seat, *begun, command.counts->number);
    release_held(index, *seat, *begun);
  }
  want_flush(index, *seat);
}

bool SimShards::misses(Seat& seat) {
  if (seat.events != hub::EventState::told) return true;
  if (!setting_.random.chance(setting_.plan.missed_event)) return false;
  setting_.census.add(Happening::event_missed);
  seat.events = hub::EventState::missed;
  return true;
}

/// Once its control queue is empty.
void SimShards::ask_to_be_told(std::size_t index, Seat& seat) {
  if (seat.events != hub::EventState::missed || !seat.control.empty()) return;
  seat.events = hub::EventState::asked;
  push_event(index, {ShardIndex{static_cast<std::uint8_t>(index)},
                     hub::EventsMissedEvent{seat.session, seat.attachment, seat.node}});
}

void SimShards::tell_again(std::size_t index, const hub::TellAgainCommand& command) {
  Seat* seat = find(index, command.session.slot, command.session.generation);
  if (seat == nullptr || !seat->wire || command.attachment != seat->attachment) return;
  require(seat->events == hub::EventState::asked, Checker::seam,
          "a node is told again that missed nothing");
  setting_.census.add(Happening::missed_told_again);
  seat->events = hub::EventState::told;
  for (Bytes& frame : split_frames(command.frames)) seat->control.push_back(std::move(frame));
  want_flush(index, *seat);
}

/// A REASSIGN: the provider's last messages are from its new id.
void SimShards::rename_source(std::size_t index, NodeId former, NodeId present) {
  for (auto& [group, kept] : shards_[index].kept) {
    if (kept.provider != former) continue;
    kept.provider = present;
    store_le(kept.frame.data() + proto::kSrcOffset, present.value());
  }
}

void SimShards::release(std::size_t index, hub::SessionRef session) {
  Seat* seat = find(index, session.slot, session.generation);
  require(seat != nullptr, Checker::seam, "a session is released that the shard does not know");
  setting_.trace.note("shard {a} releases slot {b}", index, session.slot.value());
  if (seat->wire) detach(*seat, proto::Goodbye{GoodbyeCode::kicked, "the session is over"});
  std::erase_if(shards_[index].kept,
                [seat](const auto& entry) { return entry.second.provider == seat->node; });
  shards_[index].seats[session.slot.value()].reset();
}

/// Nothing more is read, but what other shards still hand over is written.
void SimShards::drain(std::size_t index) {
  shards_[index].draining = true;
  for (std::size_t other = 0; other < shards_.size(); ++other) {
    if (other != index) post(index, other, {.kind = hub::MailKind::last, .frame = {}});
  }
  end_drain_if_all(index);
}

void SimShards::end_drain_if_all(std::size_t index) {
  const Shard& shard = shards_[index];
  if (!shard.draining || shard.lasts + 1 < shards_.size()) return;
  setting_.agenda.after(Time{setting_.random.between(1, 20'000)}, [this, index] {
    if (!dead_) finish_drain(index);
  });
}

void SimShards::finish_drain(std::size_t index) {
  for (const std::unique_ptr<Seat>& seat : shards_[index].seats) {
    if (seat == nullptr || !seat->wire) continue;
    flush(index, *seat);
    close(index, *seat, GoodbyeCode::draining,
          "the hub ends, or begins anew under another hub id; dial again");
  }
  push_event(index, {ShardIndex{static_cast<std::uint8_t>(index)}, hub::DrainedEvent{}});
}

void SimShards::close(std::size_t index, Seat& seat, GoodbyeCode code, const char* sentence) {
  detach(seat, proto::Goodbye{code, sentence});
  tell(index, seat, false, code, sentence);
}

void SimShards::detach(Seat& seat, std::optional<proto::Goodbye> told) {
  const WirePointer wire = std::move(seat.wire);
  seat.wire = nullptr;
  wire->attached = false;
  setting_.trace.note("wire {a} of node {b} ends with code {c}", wire->number, index_of(seat.node),
                      told ? static_cast<std::uint64_t>(told->code) : 0);
  if (told) parts_.network.to_node(wire, link_frame(seat.node, parts_.hub, proto::encode(*told)));
  parts_.network.close_by_hub(wire);
  seat.requests = 0;
  seat.control.clear();
  if (!seat.waits_when_away) lose_data(seat);
}

void SimShards::lose_data(Seat& seat) {
  if (!seat.data.empty()) setting_.census.add(Happening::frames_lost_with_connection);
  for (auto& [group, pace] : seat.paces) pace->held.clear();
  seat.data.clear();
}

void SimShards::tell(std::size_t index, const Seat& seat, bool said_by_peer, GoodbyeCode code,
                     std::string sentence) {
  push_event(index, {ShardIndex{static_cast<std::uint8_t>(index)},
                     hub::DetachedEvent{seat.session, seat.attachment, seat.node, said_by_peer,
                                        code, std::move(sentence)}});
}

void SimShards::set_mute(const WirePointer& wire, bool mute) {
  wire->mute = mute;
  const std::uint64_t silence = ++wire->mutes;
  if (!mute) return;
  setting_.agenda.after(std::chrono::milliseconds{setting_.plan.limits.silent_ms},
                        [this, wire, silence] {
                          if (dead_ || !wire->attached || !wire->mute || wire->mutes != silence)
                            return;
                          Seat& seat = *shards_[wire->shard].seats[wire->slot];
                          setting_.census.add(Happening::silent);
                          close(wire->shard, seat, GoodbyeCode::silent, "nothing was heard");
                        });
}

void SimShards::die() {
  dead_ = true;
  for (Shard& shard : shards_) {
    for (const std::unique_ptr<Seat>& seat : shard.seats) {
      if (seat == nullptr || !seat->wire) continue;
      seat->wire->attached = false;
      parts_.network.close_by_hub(seat->wire);
    }
    for (const ShardCommand& command : shard.commands) {
      const auto* attached = std::get_if<AttachCommand>(&command);
      if (attached == nullptr) continue;
      parts_.network.close_by_hub(static_cast<const WireStream&>(*attached->transport).wire());
    }
  }
}

bool SimShards::idle() const {
  return std::all_of(shards_.begin(), shards_.end(), [](const Shard& shard) {
    return shard.commands.empty() && shard.mail.empty() && shard.ready.empty() &&
           shard.events.empty();
  });
}

std::size_t SimShards::connected() const {
  std::size_t count = 0;
  for (const Shard& shard : shards_) {
    for (const std::unique_ptr<Seat>& seat : shard.seats)
      count += seat != nullptr && seat->wire ? 1 : 0;
  }
  return count;
}

SimShards::Seat* SimShards::find(std::size_t index, ConnectionSlot slot, std::uint32_t generation) {
  Shard& shard = shards_[index];
  if (slot.value() >= shard.seats.size()) return nullptr;
  Seat* seat = shard.seats[slot.value()].get();
  return seat != nullptr && seat->session.generation == generation ? seat : nullptr;
}

}  // namespace gimnet::sim
