#include "hub/control/effect_runner.hpp"

#include <algorithm>
#include <utility>

#include "hub/control/change_log.hpp"
#include "hub/shard/control_frame.hpp"
#include "proto/control/ns_register.hpp"

namespace gimnet::hub {
namespace {

using std::chrono::milliseconds;
namespace ns = proto::ns;

}  // namespace

GroupId EffectRunner::group_id(GroupIndex group) const {
  return group == kNoGroup ? GroupId{} : make_id(parts_.facts.id, group);
}

void EffectRunner::carry_out(const Effects& effects, milliseconds now) {
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
  if (parts_.membership.services().find_group(effect.index) != nullptr) {
    endings_.finish(effect.index);
    return parts_.publisher.publish_group(effect.index, parts_.membership);
  }
  if (endings_.contains(effect.index)) return;
  // Not cleared at once: its last frames may still be on their way to other shards.
  if (const auto provider_shard = parts_.publisher.end_group(effect.index)) {
    endings_.begin(effect.index, *provider_shard);
  }
}

void EffectRunner::run(const MemberChanged& effect) {
  if (!parts_.publisher.publish_member(effect.group, effect.subscriber, parts_.membership)) {
    run(GroupChanged{effect.group});
  }
}

void EffectRunner::fence_passed(const FencePassedEvent& event) {
  for (const GroupIndex group : endings_.on_passed(event)) {
    parts_.publisher.clear_group(group);
    endings_.finish(group);
  }
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

void EffectRunner::run(const ServiceMovedDue& effect) {
  const auto frame = control_frame(proto::Kind::ns, NodeId{}, parts_.facts.id, payload_of(effect));
  std::vector<std::vector<TellCommand::To>> by_shard(parts_.shards.shards());
  const auto tell = [&](std::size_t shard) {
    TellCommand command{std::exchange(by_shard[shard], {}), frame, effect.move};
    parts_.shards.send(ShardIndex{static_cast<std::uint8_t>(shard)}, std::move(command));
  };
  for (const NodeIndex subscriber : effect.subscribers) {
    const Session* session = find(subscriber);
    // When it is back it is told by tell_again().
    if (session == nullptr || !session->connected) continue;
    const std::size_t shard = session->place.shard.value();
    by_shard[shard].push_back(
        {ref_of(session->place), parts_.membership.sessions().node_id(*session)});
    if (by_shard[shard].size() == TellCommand::kToMost) tell(shard);
  }
  for (std::size_t shard = 0; shard < by_shard.size(); ++shard) {
    if (!by_shard[shard].empty()) tell(shard);
  }
}

void EffectRunner::tell_again(const Session& session, AttachCommand& command) const {
  for (const ServiceMovedDue& untold : parts_.membership.services().untold_moves(session.index)) {
    const auto frame =
        control_frame(proto::Kind::ns, command.node, parts_.facts.id, payload_of(untold));
    command.told.insert(command.told.end(), frame.begin(), frame.end());
    command.told_move = std::max(command.told_move, untold.move);
  }
}

proto::Payload EffectRunner::payload_of(const ServiceMovedDue& effect) const {
  ns::ServiceMoved event;
  event.name = effect.full_name;
  event.old_group = group_id(effect.old_group);
  event.new_group = group_id(effect.new_group);
  event.message_type = effect.message_type;
  event.instance = effect.instance;
  event.delivery = effect.delivery;
  event.window = effect.window;
  event.retain = effect.retain;
  event.direction = effect.direction;
  event.again = effect.again;
  for (const GroupIndex group : effect.between) event.between.push_back(group_id(group));
  return proto::encode(event);
}

void EffectRunner::run(const PaceDue& effect) {
  const Session* session = find(effect.subscriber);
  if (session == nullptr) return;
  const PaceTerms terms{effect.terms.window, effect.terms.depth, effect.terms.interval_us};
  parts_.shards.send(session->place.shard,
                     PaceCommand{ref_of(session->place), group_id(effect.group), terms,
                                 effect.retained, effect.was_plain});
}

void EffectRunner::run(const PaceEnded& effect) {
  const Session* session = find(effect.subscriber);
  if (session == nullptr) return;  // its subscriptions end with it
  const EndPaceCommand command{ref_of(session->place), group_id(effect.group), effect.group_gone};
  if (effect.group_gone && endings_.contains(effect.group)) {
    return endings_.defer(effect.group, session->place.shard, command);
  }
  parts_.shards.send(session->place.shard, command);
}

void EffectRunner::run(const RetainedDropped& effect) {
  const Session* session = find(effect.provider);
  if (session == nullptr) return;  // what its shard keeps of it ends with it
  parts_.shards.send(session->place.shard, ForgetRetainedCommand{group_id(effect.group)});
}

void EffectRunner::run(const SubscriberDue& effect) {
  const Session* session = find(effect.provider);
  if (session == nullptr) return;
  const auto fill = [&](auto event) {
    event.group = group_id(effect.group);
    event.node = make_id(parts_.facts.id, effect.subscriber);
    event.subscribers = effect.subscribers_now;
    return proto::encode(event);
  };
  send_event(*session, effect.joined ? fill(ns::SubscriberJoined{}) : fill(ns::SubscriberLeft{}));
}

void EffectRunner::run(const NameDecided& effect) {
  const Session* session = find(effect.node);
  if (session == nullptr) return;
  send_event(*session, effect.confirmed ? proto::encode(ns::NameConfirmed{effect.name})
                                        : proto::encode(ns::NameLost{effect.name, effect.holder,
                                                                     effect.sentence}));
}

void EffectRunner::send_event(const Session& session, const proto::Payload& payload) {
  // When it is back it is told how services moved, and learns the rest from the answers to what it
  // declares again.
  if (!session.connected) return;
  SendControlCommand command;
  command.session = ref_of(session.place);
  command.frame = control_frame(proto::Kind::ns, parts_.membership.sessions().node_id(session),
                                parts_.facts.id, payload);
  parts_.shards.send(session.place.shard, std::move(command));
}

}  // namespace gimnet::hub
