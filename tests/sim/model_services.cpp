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

void Model::tell_moved(const std::string& full_name, std::uint32_t old_group,
                       std::uint32_t new_group, const ns::Advertise& terms) {
  const Topic& topic = topics_.at(full_name);
  for (const auto& [subscriber, asked] : topic.subscribers) {
    DueEvent event;
    event.to = subscriber;
    event.operation = ns::ServiceMoved::kOperation;
    event.name = full_name;
    event.old_group = old_group;
    event.new_group = new_group;
    event.message_type = terms.message_type;
    event.delivery = terms.delivery;
    event.retain = terms.retain;
    event.direction = terms.direction;
    if (const auto pace = new_group != 0 ? pace_of(topic, subscriber) : std::nullopt)
      event.window = pace->window;
    due_.push_back(std::move(event));
  }
}

void Model::tell_provider(const std::string& full_name, std::uint32_t subscriber, bool joined) {
  const Service* provided = service(full_name);
  if (provided == nullptr) return;
  DueEvent event;
  event.to = provided->provider;
  event.operation = joined ? ns::SubscriberJoined::kOperation : ns::SubscriberLeft::kOperation;
  event.old_group = provided->group;
  event.node = subscriber;
  due_.push_back(std::move(event));
}

void Model::withdraw(const std::string& full_name, milliseconds now) {
  Topic& entry = topics_.at(full_name);
  const Service old = *entry.service;
  entry.service.reset();
  groups_.erase(old.group);
  touched_.insert(old.group);
  rest(resting_groups_, old.group, now);
  sessions_.at(old.provider).provides.erase(full_name);
  if (!entry.subscribers.empty()) census_.add(Happening::service_withdrawn);
  tell_moved(full_name, old.group, 0, old.terms);
  forget_if_unused(full_name);
}

void Model::unsubscribe(std::uint32_t index, const std::string& full_name) {
  Topic& topic = topics_.at(full_name);
  topic.subscribers.erase(index);
  if (topic.service) touched_.insert(topic.service->group);
  sessions_.at(index).subscribes.erase(full_name);
  tell_provider(full_name, index, false);
  forget_if_unused(full_name);
}

void Model::drop_undeclared(std::uint32_t index, milliseconds now) {
  const Session session = sessions_.at(index);
  for (const auto& [full_name, life] : session.subscribes) {
    if (life == session.life) continue;
    census_.add(Happening::undeclared_dropped);
    unsubscribe(index, full_name);
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
  const Service* known = service(full_name);
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
  const bool needs_group = known == nullptr || !same_stream(known->terms, *offer);
  const bool refused =
      proto::read_status(proto::split_control(asked.answer)->body).status == Status::limit;
  if (needs_group && refused && few_groups_left_) {
    if (known != nullptr) session.provides[full_name] = session.life;
    return census_.add(Happening::waits_for_returns);
  }
  require_status(asked, Status::done, Checker::limits);
  const auto answer = proto::decode_answer<ns::AdvertiseAnswer>(asked.answer);
  require(answer.has_value() && answer->subscribers == subscribers(full_name), Checker::answers,
          "ADVERTISE is answered with a wrong number of subscribers");
  session.provides[full_name] = session.life;
  if (needs_group) open_group(asked, full_name, index_of(answer->group), *offer);
  give_proof(index_of(answer->group), full_name, answer->proof);
  if (needs_group) return;
  require(index_of(answer->group) == known->group, Checker::answers,
          "a service that is advertised again changes its group");
  topics_.at(full_name).service->terms = *offer;
}

void Model::open_group(const Asked& asked, const std::string& full_name, std::uint32_t group,
                       const ns::Advertise& terms) {
  const auto free = [&](std::uint32_t index) {
    return index != 0 && !groups_.contains(index) && !rests(resting_groups_, index, asked.now);
  };
  const std::uint32_t former = index_of(terms.former_group);
  const bool claims = service(full_name) == nullptr && free(former);
  if (claims && is_proven(full_name, terms)) {
    census_.add(Happening::former_group_kept);
    require(group == former, Checker::answers,
            "a service that came back does not get its former group");
  } else {
    if (claims) census_.add(Happening::former_group_unproven);
    require(!past_.groups.contains(group), Checker::ids,
            "a new service gets a group given out before the restart");
    require(!is_somebodys(group), Checker::ids,
            "a new service gets a group that another one can prove to have had");
  }
  require(!groups_.contains(group), Checker::ids, "a service gets the group of another one");
  require(!rests(resting_groups_, group, asked.now), Checker::ids,
          "a service gets a group that rests");
  const auto entry = topics_.try_emplace(full_name).first;
  const std::uint32_t old_group = entry->second.service ? entry->second.service->group : 0;
  if (old_group != 0) {
    groups_.erase(old_group);
    touched_.insert(old_group);
    rest(resting_groups_, old_group, asked.now);
  }
  if (!entry->second.subscribers.empty()) {
    census_.add(old_group != 0 ? Happening::service_moved : Happening::subscribed_before_service);
  }
  entry->second.service = Service{group, asked.index, terms, ++streams_};
  for (auto& [index, subscriber] : entry->second.subscribers)
    subscriber.once_plain = subscriber.once_paced = false;
  count_delivery(terms, census_);
  touched_.insert(group);
  groups_[group] = &*entry;
  groups_given_.push_back(group);
  forgotten_groups_.erase(group);
  tell_moved(full_name, old_group, group, terms);
}

void Model::judge_withdraw(const Asked& asked) {
  const auto wanted = proto::decode<ns::Withdraw>(asked.payload);
  if (!wanted) return require_status(asked, Status::bad_request, Checker::answers);
  const HubId owner = hub_of(wanted->group);
  const auto found =
      owner == hub_ || owner == kOwnHub ? groups_.find(index_of(wanted->group)) : groups_.end();
  if (found == groups_.end()) return require_status(asked, Status::not_found, Checker::answers);
  const auto& [full_name, entry] = *found->second;
  if (entry.service->provider != asked.index)
    return require_status(asked, Status::denied, Checker::answers);
  require_status(asked, Status::done, Checker::answers);
  withdraw(std::string{full_name}, asked.now);
}

}  // namespace gimnet::sim
