#include "proto/control/names.hpp"
#include "tests/sim/model.hpp"

// Services of the reference model, and who hears of them.

namespace gimnet::sim {

using proto::Status;
namespace ns = proto::ns;

namespace {

void count_delivery(const ns::Advertise& terms, Census& census) {
  if (terms.delivery == ns::Delivery::latest) census.add(Happening::service_latest);
  if (terms.delivery == ns::Delivery::sync) census.add(Happening::service_sync);
  if (terms.retain) census.add(Happening::service_retained);
}

bool same_stream(const ns::Advertise& a, const ns::Advertise& b) {
  return a.message_type == b.message_type && a.instance == b.instance &&
         a.direction == b.direction && a.delivery == b.delivery &&
         Model::window_of(a) == Model::window_of(b) && a.retain == b.retain;
}

bool same_terms(const ns::Advertise& a, const ns::Advertise& b) {
  return same_stream(a, b) && a.metadata == b.metadata;
}

}  // namespace

const Model::Topic* Model::topic(const std::string& full_name) const {
  const auto found = topics_.find(full_name);
  return found == topics_.end() ? nullptr : &found->second;
}

std::size_t Model::subscribers(const std::string& full_name) const {
  const Topic* found = topic(full_name);
  return found == nullptr ? 0 : found->subscribers.size();
}

const Model::Service* Model::service(const std::string& full_name) const {
  const Topic* found = topic(full_name);
  return found == nullptr || !found->service ? nullptr : &*found->service;
}

void Model::forget_if_unused(const std::string& full_name) {
  const auto found = topics_.find(full_name);
  if (!found->second.service && found->second.subscribers.empty()) topics_.erase(found);
}

void Model::note_if_unused(const std::string& full_name, milliseconds now) {
  Topic& topic = topics_.at(full_name);
  if (!topic.service || topic.service->provided() || !topic.subscribers.empty()) return;
  topic.unused_until = now + milliseconds{limits_.grace_ms};
}

void Model::give_back_unused(milliseconds now) {
  std::vector<std::string> over;
  for (const auto& [full_name, topic] : topics_) {
    if (topic.unused_until && *topic.unused_until <= now) over.push_back(full_name);
  }
  for (const std::string& full_name : over) {
    census_.add(Happening::group_given_back);
    leave_group(full_name, now);
    topics_.erase(full_name);
  }
}

void Model::leave_group(const std::string& full_name, milliseconds now) {
  Topic& topic = topics_.at(full_name);
  const std::uint32_t group = topic.service->group;
  topic.service.reset();
  groups_.erase(group);
  touched_.insert(group);
  rest(resting_groups_, group, now);
}

void Model::withdraw(const std::string& full_name, milliseconds now) {
  Topic& entry = topics_.at(full_name);
  sessions_.at(entry.service->provider).provides.erase(full_name);
  entry.service->provider = 0;
  entry.service->stream = 0;
  entry.service->away = false;
  touched_.insert(entry.service->group);
  if (!entry.subscribers.empty()) census_.add(Happening::service_withdrawn);
  moved_services_.insert(full_name);
  note_if_unused(full_name, now);
}

void Model::begin_away(const Session& session) {
  for (const auto& [full_name, life] : session.provides) {
    Service& service = *topics_.at(full_name).service;
    if (service.terms.direction != ns::Direction::accepts || std::exchange(service.away, true))
      continue;
    if (!topics_.at(full_name).subscribers.empty()) census_.add(Happening::service_away);
    moved_services_.insert(full_name);
  }
}

void Model::unsubscribe(std::uint32_t index, const std::string& full_name, milliseconds now) {
  Topic& topic = topics_.at(full_name);
  topic.subscribers.erase(index);
  if (topic.service) touched_.insert(topic.service->group);
  sessions_.at(index).subscribes.erase(full_name);
  resubscribed_.insert(full_name);
  note_if_unused(full_name, now);
  forget_if_unused(full_name);
}

void Model::drop_undeclared(std::uint32_t index, milliseconds now) {
  const Session session = sessions_.at(index);
  for (const auto& [full_name, life] : session.subscribes) {
    if (life == session.life) continue;
    census_.add(Happening::undeclared_dropped);
    unsubscribe(index, full_name, now);
  }
  for (const auto& [full_name, life] : session.provides) {
    if (life == session.life) continue;
    census_.add(Happening::undeclared_dropped);
    withdraw(full_name, now);
  }
}

void Model::judge_advertise(const Asked& asked) {
  const auto offer = proto::decode<ns::Advertise>(asked.payload);
  if (!offer) return require_status(asked, Status::bad_request, Checker::answers);
  Session& session = asked.session;
  const std::string full_name = proto::join_service_name(session.name, offer->service);
  if (session.name.empty() || !proto::valid_service_name(offer->service) ||
      !proto::valid_name(full_name)) {
    return require_status(asked, Status::bad_request, Checker::answers);
  }
  if (const Status status = judge_delivery(*offer); status != Status::done) {
    census_.add(Happening::delivery_refused);
    return require_status(asked, status, Checker::limits);
  }
  const Service* standing = service(full_name);
  const Service* known = standing != nullptr && standing->provided() ? standing : nullptr;
  const bool said_before =
      known != nullptr && known->provider == asked.index && same_terms(known->terms, *offer);
  if (!said_before && !may_declare(asked, Happening::services_rate))
    return require_status(asked, Status::rate, Checker::limits);
  if (known != nullptr && known->provider != asked.index)
    return require_status(asked, Status::taken, Checker::names);
  if (known == nullptr && session.provides.size() >= limits_.services_per_node) {
    census_.add(Happening::services_limit);
    return require_status(asked, Status::limit, Checker::limits);
  }
  const bool needs_group = standing == nullptr || !same_stream(standing->terms, *offer);
  require_status(asked, Status::done, Checker::limits);
  const auto answer = proto::decode_answer<ns::AdvertiseAnswer>(asked.answer);
  require(answer.has_value() && answer->subscribers == subscribers(full_name), Checker::answers,
          "ADVERTISE is answered with a wrong number of subscribers");
  session.provides[full_name] = session.life;
  const std::uint32_t group = index_of(answer->group);
  if (needs_group) return open_group(asked, full_name, group, *offer);
  require(group == standing->group, Checker::answers,
          "a service with the same terms changes its group");
  Topic& topic = topics_.at(full_name);
  if (known == nullptr) take_over(asked, full_name, topic);
  topic.service->terms = *offer;
  if (std::exchange(topic.service->away, false)) moved_services_.insert(full_name);
}

void Model::take_over(const Asked& asked, const std::string& full_name, Topic& topic) {
  topic.service->provider = asked.index;
  topic.service->stream = ++streams_;
  topic.unused_until.reset();
  touched_.insert(topic.service->group);
  moved_services_.insert(full_name);
  if (!topic.subscribers.empty()) census_.add(Happening::provider_changed);
}

void Model::open_group(const Asked& asked, const std::string& full_name, std::uint32_t group,
                       const ns::Advertise& terms) {
  require(!past_.groups.contains(group), Checker::ids,
          "a new service gets a group given out before the restart");
  require(!groups_.contains(group), Checker::ids, "a service gets the group of another one");
  require(!rests(resting_groups_, group, asked.now), Checker::ids,
          "a service gets a group that rests");
  const auto entry = topics_.try_emplace(full_name).first;
  Topic& topic = entry->second;
  if (!topic.subscribers.empty())
    census_.add(topic.service ? Happening::service_moved : Happening::subscribed_before_service);
  if (topic.service) leave_group(full_name, asked.now);
  topic.unused_until.reset();
  topic.service = Service{group, asked.index, terms, ++streams_};
  for (auto& [index, subscriber] : topic.subscribers)
    subscriber.once_plain = subscriber.once_paced = false;
  count_delivery(terms, census_);
  touched_.insert(group);
  groups_[group] = &*entry;
  groups_given_.push_back(group);
  moved_services_.insert(full_name);
}

void Model::judge_withdraw(const Asked& asked) {
  const auto wanted = proto::decode<ns::Withdraw>(asked.payload);
  if (!wanted) return require_status(asked, Status::bad_request, Checker::answers);
  const HubId owner = hub_of(wanted->group);
  const auto found =
      owner == hub_ || owner == kOwnHub ? groups_.find(index_of(wanted->group)) : groups_.end();
  if (found == groups_.end() || !found->second->second.service->provided())
    return require_status(asked, Status::not_found, Checker::answers);
  const auto& [full_name, entry] = *found->second;
  if (entry.service->provider != asked.index)
    return require_status(asked, Status::denied, Checker::answers);
  require_status(asked, Status::done, Checker::answers);
  withdraw(std::string{full_name}, asked.now);
}

}  // namespace gimnet::sim
