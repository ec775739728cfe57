#include "hub/control/effect_runner.hpp"

#include <map>
#include <utility>

#include "hub/control/change_log.hpp"
#include "hub/control/state/records.hpp"
#include "hub/shard/control_frame.hpp"
#include "proto/control/ns_register.hpp"

namespace gimnet::hub {
namespace {

using std::chrono::milliseconds;
namespace ns = proto::ns;

}  // namespace

GroupId EffectRunner::group_id(GroupIndex group) const { return make_id(parts_.facts.id, group); }

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
}

void EffectRunner::run(const ProviderChanged& effect) {
  parts_.publisher.publish_provider(effect.index, parts_.membership);
}

void EffectRunner::run(const MemberChanged& effect) {
  if (!parts_.publisher.publish_member(effect.group, effect.subscriber, parts_.membership)) {
    run(GroupChanged{effect.group});
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

/// One frame for all that have the same window.
void EffectRunner::run(const ServiceMoved& effect) {
  const Topic* topic = parts_.membership.services().find(effect.full_name);
  if (topic == nullptr) return;
  std::map<std::uint32_t, std::vector<std::vector<TellCommand::To>>> by_window;
  const auto frame = [&](std::uint32_t window) {
    return control_frame(proto::Kind::ns, NodeId{}, parts_.facts.id, payload_of(*topic, window));
  };
  const auto tell = [&](std::uint32_t window, std::size_t shard, std::vector<TellCommand::To>& to) {
    parts_.shards.send(ShardIndex{static_cast<std::uint8_t>(shard)},
                       TellCommand{std::exchange(to, {}), frame(window)});
  };
  for (const NodeIndex subscriber : topic->subscribers) {
    const Session* session = find(subscriber);
    // When it is back it is told by tell_again().
    if (session == nullptr || !session->connected) continue;
    const std::uint32_t window = topic->window_of(subscriber);
    auto& by_shard = by_window[window];
    by_shard.resize(parts_.shards.shards());
    const std::size_t shard = session->place.shard.value();
    by_shard[shard].push_back(
        {ref_of(session->place), parts_.membership.sessions().node_id(*session)});
    if (by_shard[shard].size() == TellCommand::kToMost) tell(window, shard, by_shard[shard]);
  }
  for (auto& [window, by_shard] : by_window) {
    for (std::size_t shard = 0; shard < by_shard.size(); ++shard) {
      if (!by_shard[shard].empty()) tell(window, shard, by_shard[shard]);
    }
  }
}

void EffectRunner::tell_again(Session& session, AttachCommand& command) const {
  const Services& services = parts_.membership.services();
  for (const Topic* topic : services.moved_since(session.index, session.change_seen)) {
    const auto frame = control_frame(proto::Kind::ns, command.node, parts_.facts.id,
                                     payload_of(*topic, topic->window_of(session.index)));
    command.told.insert(command.told.end(), frame.begin(), frame.end());
  }
  session.change_seen = services.changes();
}

proto::Payload EffectRunner::payload_of(const Topic& topic, std::uint32_t window) const {
  ns::ServiceMoved event;
  event.name = std::string{topic.full_name};
  const NameCopies* names = parts_.names == nullptr ? nullptr : parts_.names->copies();
  put_state(event, HubTitle{parts_.facts.id, parts_.facts.name}, topic, parts_.membership, names);
  event.window = window;
  return proto::encode(event);
}

void EffectRunner::run(const PaceDue& effect) {
  const Session* session = find(effect.subscriber);
  if (session == nullptr) return;
  const PaceTerms terms{effect.terms.window, effect.terms.depth, effect.terms.interval_us};
  parts_.shards.send(session->place.shard,
                     PaceCommand{ref_of(session->place), group_id(effect.group), terms,
                                 effect.retained, effect.was_plain, effect.terms.number});
}

void EffectRunner::run(const PaceEnded& effect) {
  const Session* session = find(effect.subscriber);
  if (session == nullptr) return;  // its subscriptions end with it
  parts_.shards.send(session->place.shard,
                     EndPaceCommand{ref_of(session->place), group_id(effect.group)});
}

void EffectRunner::run(const RetainedDropped& effect) {
  const Session* session = find(effect.provider);
  if (session == nullptr) return;  // what its shard keeps of it ends with it
  parts_.shards.send(
      session->place.shard,
      ForgetRetainedCommand{group_id(effect.group), make_id(parts_.facts.id, effect.provider)});
}

void EffectRunner::run(const SubscribersChanged& effect) {
  const Topic* topic = parts_.membership.services().find(effect.full_name);
  if (topic == nullptr || !topic->provided()) return;
  const Session* session = find(topic->service->provider);
  if (session == nullptr) return;
  const auto number = static_cast<std::uint32_t>(topic->subscribers.size());
  send_event(*session, proto::encode(ns::Subscribers{group_id(topic->service->group), number}));
}

void EffectRunner::run(const NameLost& effect) {
  const Session* session = find(effect.node);
  if (session == nullptr) return;
  send_event(*session, proto::encode(ns::NameLost{effect.name, effect.holder, effect.sentence}));
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
