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
               const Membership& membership) {
  if (!topic.service) return;
  const Service& service = *topic.service;
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
}

ns::ServiceRecord record_of(const HubTitle& hub, const Topic& topic) {
  const Service& service = *topic.service;
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
  record.subscribers = static_cast<std::uint32_t>(topic.subscribers.size());
  record.hub_name = hub.name;
  return record;
}

}  // namespace gimnet::hub
