#include "client/gimi/service_table.hpp"

#include <algorithm>
#include <utility>

#include "client/gimi/connection_events.hpp"
#include "client/gimi/ending.hpp"

namespace gimnet::gimi {
namespace {

nif_service description_of(const std::string& name, MessageKey key, const std::string& metadata) {
  nif_service service{};
  service.struct_size = sizeof service;
  service.name = name.c_str();
  service.message_type = key.type;
  service.instance = key.instance;
  service.metadata = metadata.empty() ? nullptr : metadata.c_str();
  return service;
}

}  // namespace

class ServiceTable::Asking {
 public:
  /// `service`: an own one, that is advertised.
  explicit Asking(ServiceTable& table, std::string service = {}) : table_(table) {
    const MutexLock lock(table_.mutex_);
    ++table_.open_;
    table_.advertising_ = std::move(service);
  }
  ~Asking() {
    {
      const MutexLock lock(table_.mutex_);
      --table_.open_;
      table_.advertising_.clear();
    }
    static_cast<void>(nif_deliver(table_.uplink_.node()));
  }
  Asking(const Asking&) = delete;
  Asking& operator=(const Asking&) = delete;

 private:
  ServiceTable& table_;
};

std::optional<Failure> ServiceTable::obstacle(const std::string& own_name,
                                              const std::string& name) {
  if (own_name.empty()) {
    return Failure{Status::denied,
                   "a node without a name has no services: give it one to offer '" + name + "'"};
  }
  if (own_names_.contains(name)) {
    return Failure{Status::taken, "this node offers " + own_name + "/" + name + " already"};
  }
  return std::nullopt;
}

Outcome<PublishedService*> ServiceTable::advertise(const std::string& own_name,
                                                   const std::string& name,
                                                   const PublishOptions& options, Timeout timeout) {
  const Turn turn(asking_, timeout);
  if (!turn) return Turn::failure("advertise " + own_name + "/" + name);
  if (auto failure = obstacle(own_name, name)) return *failure;
  const Asking asking(*this, name);
  nif_service service = description_of(name, options.key, options.metadata);
  service.direction = NIF_PROVIDES;
  service.delivery = static_cast<std::uint8_t>(options.delivery);
  service.window = options.delivery == Delivery::sync ? options.window : 0;
  service.retain = options.retain ? 1 : 0;
  std::uint32_t group = 0;
  std::uint32_t subscribers = 0;
  const nif_status status =
      nif_advertise(uplink_.node(), &service, &group, &subscribers, turn.left_ms());
  if (status != NIF_OK) return failure_of(status, "advertise " + own_name + "/" + name);
  auto published =
      std::make_unique<PublishedService>(uplink_, name, own_name + "/" + name, options);
  published->on_group(group);
  published->on_subscribers(subscribers);
  own_names_.insert(name);
  const MutexLock lock(mutex_);
  if (end_) published->end(end_);
  published_by_name_.insert_or_assign(name, published.get());
  published_by_group_[group] = published.get();
  return published_.emplace_back(std::move(published)).get();
}

Outcome<std::uint32_t> ServiceTable::accept(const std::string& own_name, const std::string& name,
                                            const AcceptOptions& options, Timeout timeout) {
  const Turn turn(asking_, timeout);
  if (!turn) return Turn::failure("accept " + own_name + "/" + name);
  if (auto failure = obstacle(own_name, name)) return *failure;
  nif_service service = description_of(name, options.key, options.metadata);
  service.direction = NIF_ACCEPTS;
  std::uint32_t group = 0;
  const nif_status status =
      nif_advertise(uplink_.node(), &service, &group, nullptr, turn.left_ms());
  if (status != NIF_OK) return failure_of(status, "accept " + own_name + "/" + name);
  own_names_.insert(name);
  return group;
}

void ServiceTable::withdraw(PublishedService& service) {
  const Turn turn(asking_, Turn::Leaving{});
  own_names_.erase(service.name());
  service.end({Status::closed, "the service was withdrawn"});
  {
    const MutexLock lock(mutex_);
    published_by_name_.erase(service.name());
    std::erase_if(published_by_group_,
                  [&service](const auto& entry) { return entry.second == &service; });
  }
  // By name: NIF may know of a move that is not told here yet.
  static_cast<void>(nif_withdraw_service(uplink_.node(), service.name().c_str(), turn.left_ms()));
}

void ServiceTable::withdraw_accepted(const std::string& name) {
  const Turn turn(asking_, Turn::Leaving{});
  own_names_.erase(name);
  static_cast<void>(nif_withdraw_service(uplink_.node(), name.c_str(), turn.left_ms()));
}

ServiceTable::Subscribed ServiceTable::entry(const std::string& full_name) {
  const MutexLock lock(mutex_);
  const auto place = subscribed_.find(full_name);
  if (place != subscribed_.end()) return place->second;
  auto service = std::make_shared<SubscribedService>(full_name, inbox_);
  if (end_) service->end(end_);
  return subscribed_.emplace(full_name, std::move(service)).first->second;
}

/// A former group leads to the service until as many younger ones came: the event that a provider
/// left may overtake what it published.
void ServiceTable::set_place(const Subscribed& subscribed, const ServicePlace& place) {
  // The present one and the one before: a service gets another group when its terms change.
  constexpr std::size_t kGroups = 2;
  SubscribedService& service = *subscribed;
  service.place = place;
  service.on_place(place);
  if (place.group == 0) return;
  subscribed_by_group_[place.group] =
      subscribed;  // also a former one again, which was another service's meanwhile
  std::erase(service.groups, place.group);
  service.groups.push_back(place.group);
  if (service.groups.size() <= kGroups) return;
  forget_group(service, service.groups.front());
  service.groups.erase(service.groups.begin());
}

void ServiceTable::forget_group(SubscribedService& service, std::uint32_t group) {
  const auto place = subscribed_by_group_.find(group);
  if (place != subscribed_by_group_.end() && place->second.get() == &service)
    subscribed_by_group_.erase(place);
}

nif_status ServiceTable::ask(const Subscribed& service, std::int32_t timeout_ms) {
  nif_subscription found{};
  const Share share = service->share();
  const nif_pace wanted{sizeof wanted, share.window, share.depth, share.rate_hz};
  const nif_status status =
      nif_subscribe_paced(uplink_.node(), service->name().c_str(), &wanted, &found, timeout_ms);
  if (status != NIF_OK) return status;
  service->on_granted(share.rate_hz);
  service->retained = found.retain != 0;
  const ServicePlace place{found.group,
                           found.provider,
                           found.session,
                           {found.message_type, found.instance},
                           found.direction == NIF_ACCEPTS,
                           found.delivery == NIF_LATEST_DELIVERY,
                           uplink_.is_away(service->name())};
  const bool was_refused = service->is_refused();
  {
    const MutexLock lock(mutex_);
    set_place(service, place);
  }
  // The hub tells of no move to who did not subscribe.
  if (was_refused) on_moved_(service->name(), place);
  return NIF_OK;
}

Outcome<ServiceTable::Reading> ServiceTable::subscribe(const std::string& full_name,
                                                       const SubscribeOptions& wish) {
  const Turn turn(asking_, wish.timeout);
  if (!turn) return Turn::failure("subscribe " + full_name);
  const Asking asking(*this);
  const Subscribed service = entry(full_name);
  const bool is_first = !service->is_read();
  const Reading reading{service, service->add(wish)};
  nif_status status = ask(service, turn.left_ms());
  const bool ended = status == NIF_OK && !is_first && service->retained;
  if (ended) {
    // The hub gives the last message to who begins, and this subscriber does.
    static_cast<void>(nif_unsubscribe(uplink_.node(), full_name.c_str(), turn.left_ms()));
    status = ask(service, turn.left_ms());
  }
  if (status != NIF_OK) {
    auto failure = failure_of(status, "subscribe " + full_name);
    service->remove(*reading.subscriber);
    // As before: the hub does not know this one.
    if (ended) {
      const nif_status again = ask(service, kLeaveTimeoutMs);
      if (again != NIF_OK) service->on_refused(failure_of(again, "subscribe " + full_name));
    } else if (service->followed && is_first) {
      static_cast<void>(ask(service, 0));
    }
    forget_unused(service);
    return failure;
  }
  // It may have been subscribed before, to know where it is or when it was another one.
  const char* const why = service->gives_none();
  if (why == nullptr) return reading;
  leave(reading, turn.left_ms());
  return Failure{Status::not_found, "cannot subscribe to '" + full_name + "': it " + why};
}

void ServiceTable::unsubscribe(const Reading& reading) {
  const Turn turn(asking_, Turn::Leaving{});
  leave(reading, turn.left_ms());
}

void ServiceTable::leave(const Reading& reading, std::int32_t timeout_ms) {
  const Subscribed& service = reading.service;
  const Share before = service->share();
  service->remove(*reading.subscriber);
  // If the hub is not told in time, because of a break, NIF tells it with the next connection.
  if (service->is_read() || service->followed) {
    if (service->share() == before) return;
    const Asking asking(*this);  // for what is told behind the answer
    static_cast<void>(ask(service, timeout_ms));
    return;
  }
  static_cast<void>(nif_unsubscribe(uplink_.node(), service->name().c_str(), timeout_ms));
  forget_unused(service);
}

void ServiceTable::forget_unused(const Subscribed& service) {
  if (service->is_read() || service->followed) return;
  const MutexLock lock(mutex_);
  end_groups(*service);
  subscribed_.erase(service->name());
}

/// Messages on their way of a subscription that ended are no loss.
void ServiceTable::end_groups(SubscribedService& service) {
  for (const std::uint32_t group : service.groups) {
    forget_group(service, group);
    ended_groups_.push_back(group);
  }
  service.groups.clear();
  while (ended_groups_.size() > kEndedGroupsMax) ended_groups_.pop_front();
}

Outcome<ServiceTable::Stream> ServiceTable::follow(const std::string& full_name, Timeout timeout,
                                                   const MakeStream& make) {
  const Turn turn(asking_, timeout);
  if (!turn) return Turn::failure("send to " + full_name);
  const Asking asking(*this);
  const Subscribed service = entry(full_name);
  // Also one that is read: what the hub told of it last may still be under way.
  if (!service->followed || service->is_refused()) {
    const nif_status status = ask(service, turn.left_ms());
    if (status != NIF_OK) {
      auto failure = failure_of(status, "send to " + full_name);
      forget_unused(service);
      return failure;
    }
  }
  service->followed = true;
  ServicePlace place;
  {
    const MutexLock lock(mutex_);
    place = service->place;
  }
  return make(place);
}

void ServiceTable::unfollow(const std::string& full_name, const std::function<bool()>& again) {
  const Turn turn(asking_, Turn::Leaving{});
  if (again()) return;
  Subscribed service;
  {
    const MutexLock lock(mutex_);
    const auto known = subscribed_.find(full_name);
    if (known == subscribed_.end()) return;
    service = known->second;
  }
  service->followed = false;
  if (service->is_read()) return;
  // If the hub is not told in time, NIF tells it with the next connection.
  static_cast<void>(nif_unsubscribe(uplink_.node(), full_name.c_str(), turn.left_ms()));
  forget_unused(service);
}

ServiceTable::Found ServiceTable::subscribed(std::uint32_t group) {
  const MutexLock lock(mutex_);
  const auto place = subscribed_by_group_.find(group);
  if (place == subscribed_by_group_.end()) {
    if (open_ != 0) return {Place::not_yet, nullptr};
    const bool ended = std::ranges::find(ended_groups_, group) != ended_groups_.end();
    return {ended ? Place::unwanted : Place::unknown, nullptr};
  }
  // Of a service that is only sent to nobody takes messages.
  if (!place->second->is_read()) return {Place::unwanted, nullptr};
  return {Place::found, place->second};
}

ServiceTable::Place ServiceTable::on_subscribers(std::uint32_t group, std::size_t count) {
  const MutexLock lock(mutex_);
  const auto place = published_by_group_.find(group);
  if (place == published_by_group_.end()) return unknown();
  place->second->on_subscribers(count);
  return Place::found;
}

void ServiceTable::on_not_retained(std::uint32_t group,
                                   const std::optional<proto::gimi::MessageHeader>& sent) {
  const MutexLock lock(mutex_);
  const auto place = published_by_group_.find(group);
  if (place != published_by_group_.end()) place->second->on_not_retained(sent);
}

ServiceTable::Place ServiceTable::on_service_moved(const nif_incoming& moved) {
  const std::string full_name = moved.text;
  const ServicePlace place{moved.group,
                           moved.from,
                           moved.count,
                           {moved.message_type, moved.instance},
                           moved.direction == NIF_ACCEPTS,
                           moved.delivery == NIF_LATEST_DELIVERY,
                           (moved.flags & NIF_SERVICE_AWAY) != 0};
  {
    const MutexLock lock(mutex_);
    if (open_ != 0) return Place::not_yet;
    const auto known = subscribed_.find(full_name);
    if (known == subscribed_.end()) return Place::unknown;
    set_place(known->second, place);
    if (const auto refusal = refusal_of(moved)) known->second->on_refused(*refusal);
  }
  on_moved_(full_name, place);
  return Place::found;
}

void ServiceTable::on_renamed(const std::string& own_name) {
  const MutexLock lock(mutex_);
  for (auto& service : published_) service->on_renamed(own_name);
}

ServiceTable::Place ServiceTable::on_own_service_moved(const std::string& name,
                                                       const OwnMove& move) {
  const MutexLock lock(mutex_);
  const auto known = published_by_name_.find(name);
  if (known == published_by_name_.end())
    return name == advertising_ ? Place::not_yet : Place::unknown;
  PublishedService* const service = known->second;
  if (service->group() != move.former) return Place::unknown;
  // By service, not by id: a hub that lost its state may have given its former group to another
  // one.
  std::erase_if(published_by_group_,
                [service](const auto& entry) { return entry.second == service; });
  if (move.group != 0) published_by_group_[move.group] = service;
  service->on_group(move.group);
  if (move.refusal) service->on_refused(*move.refusal);
  return Place::found;
}

void ServiceTable::on_reconnected() {
  const MutexLock lock(mutex_);
  for (auto& [name, service] : published_by_name_) service->on_reconnected();
  // The hub may have begun anew.
  for (auto& [name, service] : subscribed_) service->missed_told = 0;
  if (!subscribed_.empty()) inbox_.note_missed();
}

void ServiceTable::tell_missed() {
  std::vector<std::string> news;  // written without the lock: standard error may be a full pipe
  {
    const MutexLock lock(mutex_);
    for (auto& [name, service] : subscribed_) {
      if (std::string words = service->news_of_missed(); !words.empty())
        news.push_back(std::move(words));
      const std::uint64_t total = service->missed_in_all();
      if (total == service->missed_told || service->place.group == 0) continue;
      if (uplink_.tell_missed(service->place.group, total)) service->missed_told = total;
    }
  }
  for (const std::string& words : news) log_info(uplink_.node_name(), words);
}

void ServiceTable::end(const Ending& ending) {
  const MutexLock lock(mutex_);
  end_ = ending;
  for (auto& service : published_) service->end(ending);
  for (auto& [name, service] : subscribed_) service->end(ending);
}

}  // namespace gimnet::gimi
