#include "hub/control/effect_runner.hpp"

#include <string>
#include <utility>

#include "base/ids.hpp"
#include "base/log.hpp"
#include "hub/shard/control_frame.hpp"
#include "proto/control/ns_register.hpp"

namespace gimnet::hub {

namespace {

using proto::ns::ChangeKind;

const char* happening(ChangeKind kind) {
  switch (kind) {
    case ChangeKind::joined:
      return "has joined";
    case ChangeKind::left:
      return "has left for good: its id and name are free";
    case ChangeKind::away:
      return "is away: its grace time runs";
    case ChangeKind::back:
      return "is back";
    case ChangeKind::renamed:
      return "has another name";
    case ChangeKind::advertised:
      return "is there";
    case ChangeKind::withdrawn:
      return "was withdrawn";
    case ChangeKind::begin:
    case ChangeKind::present:
    case ChangeKind::end:
    case ChangeKind::changed:
      break;
  }
  return "has changed";
}

std::string node_text(HubId hub, NodeIndex index, const std::string& name) {
  const std::string id = "node " + to_string(make_id(hub, index));
  return name.empty() ? id : id + " '" + name + "'";
}

/// Limited by rate: a node that comes and goes again and again keeps no others out of the log.
void say(const char* what, const std::string& about, const std::string& more = {}) {
  log_line(LogLevel::debug, {what, about}, about + " " + what + more);
}

}  // namespace

void log_change(const NodeNoted& noted, const Membership& membership, HubId hub) {
  if (!log_enabled(LogLevel::debug)) return;
  const Session* session =
      noted.kind == ChangeKind::left ? nullptr : membership.sessions().find(noted.index);
  const std::string name = session != nullptr ? session->name.str() : noted.name;
  const std::string before =
      noted.kind == ChangeKind::renamed ? ", before '" + noted.former_name + "'" : "";
  say(happening(noted.kind), node_text(hub, noted.index, name), before);
}

void log_change(const ServiceNoted& noted, const Membership& membership, HubId hub) {
  if (!log_enabled(LogLevel::debug)) return;
  const Topic* topic =
      noted.kind == ChangeKind::withdrawn ? nullptr : membership.topics().find_group(noted.group);
  const std::string name = topic != nullptr ? std::string{topic->full_name} : noted.full_name;
  say(happening(noted.kind), "service " + to_string(make_id(hub, noted.group)) + " '" + name + "'",
      ", of " + node_text(hub, noted.provider, {}));
}

void log_change(const RenumberDue& due, const Membership& membership, HubId hub) {
  if (!log_enabled(LogLevel::debug)) return;
  const Session* session = membership.sessions().find(due.index);
  say("has another id",
      node_text(hub, due.former, session != nullptr ? session->name.str() : std::string{}),
      ", " + to_string(make_id(hub, due.index)));
}

namespace {

using std::chrono::milliseconds;
namespace ns = proto::ns;

}  // namespace

GroupId EffectRunner::group_id(GroupIndex group) const { return make_id(parts_.facts.id, group); }

void EffectRunner::carry_out(const Effects& effects, milliseconds now) {
  to_tell_ = parts_.limits.told_at_once;
  // First what has to outlive a crash, and once for all of them: what follows is seen by others.
  for (const Effect& effect : effects) {
    if (!std::holds_alternative<StateDue>(effect)) continue;
    parts_.keeper.keep(parts_.membership, now);
    break;
  }
  for (const Effect& effect : effects) {
    std::visit(
        [&](const auto& one) {
          using One = std::remove_cvref_t<decltype(one)>;
          if constexpr (std::is_same_v<One, NodeNoted> || std::is_same_v<One, ServiceNoted>) {
            log_change(one, parts_.membership, parts_.facts.id);
            parts_.watches.note(one, parts_.membership, now);
            if (parts_.names != nullptr) parts_.names->note(one);
          } else {
            run(one);
          }
        },
        effect);
  }
}

void EffectRunner::run(const StateDue&) {}  // carry_out() has seen to it

void EffectRunner::run(const CloseDue& effect) {
  parts_.shards.send(effect.place.shard,
                     CloseCommand{ref_of(effect.place), effect.code, effect.sentence});
}

void EffectRunner::run(const NodeChanged& effect) {
  parts_.publisher.publish_node(effect.index, parts_.membership);
}

void EffectRunner::run(const GroupChanged& effect) {
  parts_.publisher.publish_group(effect.index, parts_.membership);
  if (parts_.groups != nullptr) parts_.groups->note_own(effect.index);
}

void EffectRunner::run(const AwayGroupChanged& effect) {
  if (parts_.groups != nullptr) parts_.groups->note_away(effect.group);
}

void EffectRunner::run(const AcceptanceChanged& effect) {
  if (parts_.names != nullptr) parts_.names->note(effect);
}

void EffectRunner::run(const MemberChanged& effect) {
  parts_.publisher.publish_members(effect.group, {&effect.subscriber, 1}, parts_.membership);
}

void EffectRunner::run(const SessionEnded& effect) {
  parts_.shards.send(effect.place.shard, ReleaseCommand{ref_of(effect.place)});
}

void EffectRunner::run(const RenumberDue& effect) {
  log_change(effect, parts_.membership, parts_.facts.id);
  parts_.watches.connection_ended(effect.former);
  parts_.shards.send(effect.place.shard,
                     RenumberCommand{ref_of(effect.place), make_id(parts_.facts.id, effect.index),
                                     effect.sentence});
}

void EffectRunner::run(const ServiceChanged& effect) {
  tellings_.put(effect);
  tellings_.work_off(to_tell_);
}

void EffectRunner::run(const PaceDue& effect) {
  const Session* session = find(effect.subscriber);
  const Topic* topic = parts_.membership.topics().find_group(effect.group);
  if (session != nullptr && topic != nullptr) tellings_.begin_pace(*topic, *session, false);
}

void EffectRunner::run(const PaceEnded& effect) {
  const Session* session = find(effect.subscriber);
  if (session == nullptr) return;  // its subscriptions end with it
  parts_.shards.send(session->place.shard, EndPaceCommand{ref_of(session->place), effect.group});
}

void EffectRunner::run(const RetainedDropped& effect) {
  const Session* session = find(effect.provider);
  if (session == nullptr) return;  // what its shard keeps of it ends with it
  parts_.shards.send(
      session->place.shard,
      ForgetRetainedCommand{group_id(effect.group), make_id(parts_.facts.id, effect.provider)});
}

void EffectRunner::run(const SubscribersChanged& effect) {
  const Topic* topic = parts_.membership.topics().find(effect.full_name);
  if (topic == nullptr || !topic->provided()) return;
  const Session* session = find(topic->service->provider);
  if (session == nullptr) return;
  send_event(*session, tellings_.subscribers_event(*topic));
}

void EffectRunner::run(const NameLossDue& effect) {
  const Session* session = find(effect.node);
  if (session == nullptr) return;
  // The later half of the answer to the node's own request, which nobody could tell again.
  send(*session, proto::encode(ns::NameLost{effect.name, effect.holder, effect.sentence}));
}

bool EffectRunner::tell_rest() {
  to_tell_ = parts_.limits.told_at_once;
  tellings_.work_off(to_tell_);
  return !tellings_.empty();
}

void EffectRunner::events_missed(const Session& session, std::uint32_t attachment) {
  tellings_.put(session.index, attachment);
}

void EffectRunner::send_event(const Session& session, const proto::Payload& payload) {
  SendControlCommand command;
  command.may_drop = true;
  send(session, payload, std::move(command));
}

void EffectRunner::send(const Session& session, const proto::Payload& payload,
                        SendControlCommand command) {
  // When it is back it is told how services moved, and learns the rest from the answers to what it
  // declares again.
  if (!session.connected) return;
  command.session = ref_of(session.place);
  command.frame = control_frame(proto::Kind::ns, parts_.membership.sessions().node_id(session),
                                parts_.facts.id, payload);
  parts_.shards.send(session.place.shard, std::move(command));
}

}  // namespace gimnet::hub
