#include "client/nif/declarations.hpp"

#include <algorithm>
#include <utility>

#include "client/nif/answer_status.hpp"
#include "client/nif/inbound.hpp"

namespace gimnet::nif {
namespace {

/// Whether a hub takes a service that is advertised again for what it was.
bool same_stream(proto::ns::Advertise former, const proto::ns::Advertise& now) {
  former.metadata = now.metadata;
  return former == now;
}

/// Why the hub did not take again what the record names.
void add_refusal(Record& record, const proto::Refusal& refusal) {
  record.incoming.reason = static_cast<std::uint32_t>(status_of(refusal.status));
  // Without memory for the words the reason has to do.
  if (record.payload.append(std::as_bytes(std::span(refusal.sentence)))) record.finish();
}

}  // namespace

Declarations::~Declarations() {
  for (const Item& item : events_) item.storage->release();
}

void Declarations::enter_group(Service& service, GroupId group) {
  for (auto& [name, other] : services_) {
    if (other.group == GroupId{} && other.last_group == group) other.last_group = GroupId{};
  }
  service.group = service.last_group = group;
}

void Declarations::add_service(const proto::ns::Advertise& service, GroupId group) {
  const MutexLock lock(mutex_);
  Service& own = services_[service.service];
  if (!same_stream(own.request, service)) {
    outbound_.forget_retained(service.service);  // as the hub did
    own.last_due = false;
  }
  own.request = service;
  enter_group(own, group);
  outbound_.forget_moves(group.value());
  own.ended = false;
  if (service.retain) {
    outbound_.follow_retained(service.service, group.value());
  } else {
    outbound_.forget_retained(service.service);
  }
}

void Declarations::remove_service(GroupId group) {
  const MutexLock lock(mutex_);
  std::erase_if(services_, [&](const auto& entry) {
    const bool ends = entry.second.group == group;
    if (ends) outbound_.forget_retained(entry.first);
    if (ends) outbound_.forget_moves(group.value());
    return ends;
  });
}

bool Declarations::begin_service(const std::string& service) {
  const MutexLock lock(mutex_);
  const auto found = services_.find(service);
  return found != services_.end() && std::exchange(found->second.ended, false);
}

std::optional<GroupId> Declarations::end_service(const std::string& service) {
  const MutexLock lock(mutex_);
  const auto found = services_.find(service);
  if (found == services_.end() || found->second.ended) return std::nullopt;
  outbound_.forget_retained(service);
  outbound_.forget_moves(found->second.last_group.value());
  const GroupId group = found->second.group;
  found->second.ended = true;
  if (group == GroupId{} && !found->second.asked) services_.erase(found);
  return group;
}

void Declarations::finish_service(const std::string& service, GroupId group) {
  const MutexLock lock(mutex_);
  const auto found = services_.find(service);
  if (found == services_.end() || !found->second.ended) return;
  // If it moved meanwhile, on_advertised() saw to it, and will see to anything that is still asked
  // for.
  if (found->second.group == group && !found->second.asked) services_.erase(found);
}

void Declarations::add_subscription(const proto::ns::Subscribe& subscription,
                                    const proto::ns::ServiceState& state) {
  const MutexLock lock(mutex_);
  beginning_.erase(subscription.name);
  subscriptions_.insert_or_assign(
      subscription.name,
      Subscription{subscription, state.group, state.group, state.provider, state.session});
}

std::optional<Declarations::Former> Declarations::begin_subscription(
    proto::ns::Subscribe& request) {
  const MutexLock lock(mutex_);
  const auto found = subscriptions_.find(request.name);
  if (found == subscriptions_.end()) {
    beginning_[request.name] = request.number = next_number_++;
    return std::nullopt;
  }
  request.number = found->second.ended ? next_number_++ : found->second.request.number;
  return Former{std::exchange(found->second.request, request),
                std::exchange(found->second.ended, false)};
}

void Declarations::count_anew(proto::ns::Subscribe& request) {
  const MutexLock lock(mutex_);
  request.number = next_number_++;
}

void Declarations::give_up_subscription(const std::string& full_name,
                                        const std::optional<Former>& former, bool heard) {
  const MutexLock lock(mutex_);
  beginning_.erase(full_name);
  const auto found = subscriptions_.find(full_name);
  if (!former || found == subscriptions_.end()) return;
  if (heard) found->second.request = former->request;
  found->second.ended |= former->ended;
}

bool Declarations::end_subscription(const std::string& full_name) {
  const MutexLock lock(mutex_);
  const auto found = subscriptions_.find(full_name);
  return found != subscriptions_.end() && !std::exchange(found->second.ended, true);
}

void Declarations::finish_subscription(const std::string& full_name) {
  const MutexLock lock(mutex_);
  const auto found = subscriptions_.find(full_name);
  if (found == subscriptions_.end() || !found->second.ended) return;
  credits_.forget(found->second.group);
  subscriptions_.erase(found);
}

bool Declarations::on_service_moved(const proto::ns::ServiceMoved& event) {
  const MutexLock lock(mutex_);
  const auto found = subscriptions_.find(event.name);
  if (found == subscriptions_.end()) {
    // Its SUBSCRIBE was answered a moment ago, or is not yet.
    const auto beginning = beginning_.find(event.name);
    if (beginning != beginning_.end()) credits_.open(event.group, event.window, beginning->second);
    return true;
  }
  const GroupId former = std::exchange(found->second.group, event.group);
  found->second.provider = event.provider;
  found->second.session = event.session;
  if (former != event.group && !is_subscribed(former)) credits_.forget(former);
  credits_.open(event.group, event.window, found->second.request.number);
  return !found->second.ended;
}

void Declarations::declare_again(const Occasion& occasion) {
  services_due_.clear();
  subscriptions_due_.clear();
  under_way_ = 0;
  ++round_;
  {
    const MutexLock lock(mutex_);
    for (auto& [name, service] : services_) {
      services_due_.push_back(name);
      service.last_due |= occasion.forgotten && service.request.retain;
    }
    for (auto& [name, subscription] : subscriptions_) {
      subscriptions_due_.push_back(name);
      subscription.former = subscription.group;
      if (occasion.anew) subscription.request.number = next_number_++;
    }
  }
  declaring_ = true;
  outbound_.begin_declaring();
  go_on();
}

void Declarations::go_on() {
  while (under_way_ < kAtOnce && !services_due_.empty()) {
    if (!declare_service(services_due_.front())) return;
    services_due_.pop_front();
  }
  while (under_way_ < kAtOnce && !subscriptions_due_.empty()) {
    if (!declare_subscription(subscriptions_due_.front())) return;
    subscriptions_due_.pop_front();
  }
  if (declaring_ && under_way_ == 0) end_declaring();
}

void Declarations::end_declaring() {
  declaring_ = false;
  const std::uint64_t lost = outbound_.readdress(moves());
  bring_last_messages();
  outbound_.end_declaring();
  if (lost == 0) return;
  const std::string reason = proto::drop_reason_name(proto::DropReason::no_such_group);
  Record* record = make_event(NIF_GAP, reason);
  record->incoming.from = outbound_.id();
  record->incoming.count = lost;
  record->incoming.reason = static_cast<std::uint32_t>(proto::DropReason::no_such_group);
  events_.push_back(item_of(record, reason.size()));
}

void Declarations::answered() {
  if (under_way_ > 0) --under_way_;
  go_on();
}

bool Declarations::declare_service(const std::string& service) {
  // The request leaves under the lock: what the program asks for once it has changed something here
  // comes behind it.
  const MutexLock lock(mutex_);
  const auto found = services_.find(service);
  if (found == services_.end()) return true;  // withdrawn meanwhile
  Service& own = found->second;
  if (own.ended && !own.asked) return withdraw_service(service, own.group);
  const auto handler = [this, service, round = round_](const proto::Payload& payload) {
    if (round == round_) on_advertised(service, payload);
  };
  if (!requests_.ask_later(proto::Kind::ns, proto::encode(own.request), handler)) return false;
  own.asked = true;
  ++under_way_;
  return true;
}

bool Declarations::withdraw_service(const std::string& service, GroupId group) {
  const auto handler = [this, service, group, round = round_](const proto::Payload& payload) {
    if (round == round_) on_withdrawn(service, group, payload);
  };
  if (!requests_.ask_later(proto::Kind::ns, proto::encode(proto::ns::Withdraw{group}), handler))
    return false;
  ++under_way_;
  return true;
}

void Declarations::on_withdrawn(const std::string& service, GroupId group,
                                const proto::Payload& payload) {
  const auto answer = proto::decode_answer<proto::ns::WithdrawAnswer>(payload);
  if (answer || answer.error().status == proto::Status::not_found) finish_service(service, group);
  answered();
}

bool Declarations::declare_subscription(const std::string& full_name) {
  const MutexLock lock(mutex_);  // until it leaves, as in declare_service()
  const auto found = subscriptions_.find(full_name);
  if (found == subscriptions_.end()) return true;  // ended meanwhile
  if (found->second.ended) return unsubscribe(full_name);
  const auto handler = [this, full_name, round = round_](const proto::Payload& payload) {
    if (round == round_) on_subscribed(full_name, payload);
  };
  if (!requests_.ask_later(proto::Kind::ns, proto::encode(found->second.request), handler))
    return false;
  ++under_way_;
  return true;
}

bool Declarations::unsubscribe(const std::string& full_name) {
  const auto handler = [this, full_name, round = round_](const proto::Payload& payload) {
    if (round == round_) on_unsubscribed(full_name, payload);
  };
  if (!requests_.ask_later(proto::Kind::ns, proto::encode(proto::ns::Unsubscribe{full_name}),
                           handler))
    return false;
  ++under_way_;
  return true;
}

void Declarations::on_unsubscribed(const std::string& full_name, const proto::Payload& payload) {
  const auto answer = proto::decode_answer<proto::ns::UnsubscribeAnswer>(payload);
  if (answer || answer.error().status == proto::Status::not_found) finish_subscription(full_name);
  answered();
}

/// The present groups of the own services that have or had one, and of those of others.
SendQueue::GroupMap Declarations::moves() {
  SendQueue::GroupMap moves;
  const MutexLock lock(mutex_);
  for (const auto& [name, subscription] : subscriptions_) {
    if (subscription.former != GroupId{} && subscription.group != GroupId{})
      moves[subscription.former.value()] = subscription.group.value();
  }
  for (auto& [name, service] : services_) {
    if (service.last_group == GroupId{} || service.ended) continue;
    moves[service.last_group.value()] = service.group.value();
  }
  for (auto& [name, service] : services_) {
    if (service.group != GroupId{}) enter_group(service, service.group);
  }
  return moves;
}

/// Newer messages wait until this is done: they come behind it in the queue.
void Declarations::bring_last_messages() {
  const MutexLock lock(mutex_);
  for (auto& [name, service] : services_) {
    if (!service.request.retain || service.ended) continue;
    outbound_.follow_retained(name, service.group.value());
    if (service.group != GroupId{} && std::exchange(service.last_due, false))
      outbound_.send_last_again(name);
  }
}

void Declarations::on_advertised(const std::string& service, const proto::Payload& payload) {
  const auto answer = proto::decode_answer<proto::ns::AdvertiseAnswer>(payload);
  const GroupId group = answer ? answer->group : GroupId{};
  GroupId former;
  bool changed = false;
  bool provides = false;
  {
    const MutexLock lock(mutex_);
    const auto found = services_.find(service);
    if (found != services_.end()) {
      provides =
          found->second.request.direction == proto::ns::Direction::provides && !found->second.ended;
      former = std::exchange(found->second.group, group);
      found->second.asked = false;
      changed = former != group && !found->second.ended;
      if (found->second.ended && group == GroupId{}) {
        services_.erase(found);
      } else if (found->second.ended) {
        services_due_.push_back(service);
      } else {
        found->second.last_due |= changed && found->second.request.retain;
      }
    }
  }
  if (changed) {
    Record* record = make_event(NIF_OWN_SERVICE_MOVED, service);
    record->incoming.former_group = former.value();
    record->incoming.group = group.value();
    if (!answer) add_refusal(*record, answer.error());
    events_.push_back(item_of(record, service.size()));
  }
  // Nobody told this node of those that came or went while it was away.
  if (answer && provides) {
    Record* record = make_event(NIF_SUBSCRIBERS, "");
    record->incoming.group = group.value();
    record->incoming.count = answer->subscribers;
    events_.push_back(item_of(record, 0));
  }
  answered();
}

bool Declarations::is_subscribed(GroupId group) const {
  return std::ranges::any_of(subscriptions_,
                             [&](const auto& entry) { return entry.second.group == group; });
}

void Declarations::on_subscribed(const std::string& full_name, const proto::Payload& payload) {
  const auto answer = proto::decode_answer<proto::ns::SubscribeAnswer>(payload);
  const GroupId group = answer ? answer->group : GroupId{};
  const NodeId provider = answer ? answer->provider : NodeId{};
  const std::uint64_t session = answer ? answer->session : 0;
  GroupId former;
  bool changed = false;
  {
    const MutexLock lock(mutex_);
    const auto found = subscriptions_.find(full_name);
    if (found != subscriptions_.end()) {
      former = std::exchange(found->second.group, group);
      // A hub that began anew may give another program the same group.
      changed = std::exchange(found->second.provider, provider) != provider;
      changed |= std::exchange(found->second.session, session) != session;
      const bool ended = found->second.ended;
      const bool was_refused = std::exchange(found->second.refused, !answer);
      // Also that the hub takes it again while nobody provides it: a program that was told of the
      // refusal has to know.
      changed |= former != group || was_refused == answer.has_value();
      changed = changed && !ended;
      // Requests of the program in between may never have left.
      if (ended) subscriptions_due_.push_back(full_name);
      // Its SERVICE_MOVED was lost with the connection. A hub that began anew may have given it to
      // another one.
      if (former != group && !is_subscribed(former)) credits_.forget(former);
    }
  }
  if (changed) {
    Record* record = make_event(NIF_SERVICE_MOVED, full_name);
    if (answer) {
      put_service(record->incoming, *answer);
    } else {
      add_refusal(*record, answer.error());
    }
    events_.push_back(item_of(record, full_name.size()));
  }
  answered();
}

std::vector<Item> Declarations::take_events() { return std::exchange(events_, {}); }

}  // namespace gimnet::nif
