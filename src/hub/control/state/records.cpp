#include "hub/control/state/records.hpp"

namespace gimnet::hub {

namespace ns = proto::ns;

ns::NodeRecord record_of(const HubTitle& hub, const Session& session, const Services& services,
                         std::chrono::milliseconds now) {
  ns::NodeRecord record;
  record.node = make_id(hub.id, session.index);
  record.name = session.name.str();
  record.hub = hub.id;
  record.hub_name = hub.name;
  record.connected = session.connected;
  record.description = session.description.str();
  record.place = session.origin.address.str();
  record.joined_ms = static_cast<std::uint64_t>((now - session.joined).count());
  record.services = static_cast<std::uint32_t>(services.services_of(session.index));
  return record;
}

void put_state(ns::ServiceState& state, const HubTitle& hub, const Topic& topic,
               const Membership& membership, const NameCopies* names) {
  if (names != nullptr && !topic.provided()) {
    const auto known = names->find(topic.full_name);
    if (known && known->claim->service && known->hub != hub.id &&
        known->standing != proto::ns::NameStanding::unreachable)
      return put_state(state, *known);
  }
  if (!topic.service) return;
  const LocalService& service = *topic.service;
  const Session* provider = membership.sessions().find(service.provider);
  state.group = make_id(hub.id, service.group);
  if (provider != nullptr) {
    state.provider = make_id(hub.id, service.provider);
    state.session = provider->number;
  }
  state.message_type = service.terms.message_type;
  state.instance = service.terms.instance;
  state.delivery = service.terms.delivery;
  state.retain = service.terms.retain;
  state.direction = service.terms.direction;
  state.away = service.provider_away;
}

ns::ServiceRecord record_of(const HubTitle& hub, const Topic& topic) {
  const LocalService& service = *topic.service;
  ns::ServiceRecord record;
  record.group = make_id(hub.id, service.group);
  record.name = std::string{topic.full_name};
  record.node = make_id(hub.id, service.provider);
  record.message_type = service.terms.message_type;
  record.instance = service.terms.instance;
  record.direction = service.terms.direction;
  record.delivery = service.terms.delivery;
  record.metadata = service.terms.metadata;
  record.window = service.terms.window;
  record.retain = service.terms.retain;
  record.subscribers = topic.subscriber_count();
  record.hub_name = hub.name;
  return record;
}

ns::NodeRecord node_record_of(const KnownName& known) {
  ns::NodeRecord record;
  record.node = known.claim->node;
  record.name = std::string{known.name};
  record.hub = known.hub;
  record.hub_name = std::string{known.hub_name};
  record.connected = known.standing == proto::ns::NameStanding::held;
  return record;
}

ns::ServiceRecord service_record_of(const KnownName& known) {
  const proto::route::ServiceClaim& service = *known.claim->service;
  ns::ServiceRecord record;
  record.group = service.group;
  record.name = std::string{known.name};
  record.node = known.claim->node;
  record.message_type = service.message_type;
  record.instance = service.instance;
  record.direction = service.direction;
  record.delivery = service.delivery;
  record.window = service.window;
  record.retain = service.retain;
  record.hub_name = std::string{known.hub_name};
  return record;
}

void put_state(ns::ServiceState& state, const KnownName& known) {
  const proto::route::ServiceClaim& service = *known.claim->service;
  state.group = service.group;
  state.provider = known.claim->node;
  state.session = service.session;
  state.message_type = service.message_type;
  state.instance = service.instance;
  state.delivery = service.delivery;
  state.retain = service.retain;
  state.direction = service.direction;
  state.away = known.claim->state == proto::route::NameState::away;
}

ns::Change change_of(ns::ChangeKind kind, const KnownName& known) {
  ns::Change change;
  change.kind = kind;
  if (known.claim->service) {
    change.service = service_record_of(known);
  } else {
    change.node = node_record_of(known);
  }
  return change;
}

ns::Change change_of(const NameChange& noted, std::string_view hub_name) {
  using Kind = ns::ChangeKind;
  const proto::route::NameClaim& claim = noted.after ? *noted.after : *noted.before;
  const bool service = claim.service.has_value();
  const bool held = noted.after && claim.state == proto::route::NameState::held;
  Kind kind = Kind::changed;
  if (!noted.after) {
    kind = service ? Kind::withdrawn : Kind::left;
  } else if (!noted.before) {
    kind = service ? Kind::advertised : Kind::joined;
  } else if (!service && noted.before->state != claim.state) {
    kind = held ? Kind::back : Kind::away;
  }
  return change_of(kind, {noted.name,
                          noted.hub,
                          hub_name,
                          &claim,
                          held ? ns::NameStanding::held : ns::NameStanding::away,
                          {}});
}

}  // namespace gimnet::hub
