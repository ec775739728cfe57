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

/// The hub ended it, or knew nothing of it.
template <class Answer>
bool is_gone(const Answer& answer) {
  return answer || answer.error().status == proto::Status::not_found;
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
      subscription.name, Subscription{subscription, state.group, state.group, state.provider,
                                      state.session, state.away});
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
    if (beginning == beginning_.end()) return true;
    credits_.open(event.group, event.window, beginning->second);
    answered_.insert(event.group.value());
    return true;
  }
  const GroupId former = std::exchange(found->second.group, event.group);
  found->second.take_provider(event);
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
  add_gap(lost, proto::DropReason::no_such_group);
  static_cast<Record*>(events_.back().storage)->incoming.from = outbound_.id();
}

void Declarations::add_gap(std::uint64_t count, proto::DropReason reason) {
  const std::string name = proto::drop_reason_name(reason);
  Record* record = make_event(NIF_GAP, name);
  record->incoming.count = count;
  record->incoming.reason = static_cast<std::uint32_t>(reason);
  events_.push_back(item_of(record, name.size()));
}

bool Declarations::ask(const proto::Payload& request, RequestTable::Handler on_answer) {
  const auto handler = [this, on_answer = std::move(on_answer),
                        round = round_](const proto::Payload& answer) {
    if (round != round_) return;
    on_answer(answer);
    if (under_way_ > 0) --under_way_;
    go_on();
  };
  if (!requests_.ask_later(proto::Kind::ns, request, handler)) return false;
  ++under_way_;
  return true;
}

bool Declarations::declare_service(const std::string& service) {
  // The request leaves under the lock: what the program asks for once it has changed something here
  // comes behind it.
  const MutexLock lock(mutex_);
  const auto found = services_.find(service);
  if (found == services_.end()) return true;  // withdrawn meanwhile
  Service& own = found->second;
  if (own.ended && !own.asked) return withdraw_service(service, own.group);
  const bool asked = ask(proto::encode(own.request), [this, service](const proto::Payload& answer) {
    on_advertised(service, answer);
  });
  own.asked |= asked;
  return asked;
}

bool Declarations::withdraw_service(const std::string& service, GroupId group) {
  return ask(proto::encode(proto::ns::Withdraw{group}),
             [this, service, group](const proto::Payload& payload) {
               if (is_gone(proto::decode_answer<proto::ns::WithdrawAnswer>(payload)))
                 finish_service(service, group);
             });
}

bool Declarations::declare_subscription(const std::string& full_name) {
  const MutexLock lock(mutex_);  // until it leaves, as in declare_service()
  const auto found = subscriptions_.find(full_name);
  if (found == subscriptions_.end()) return true;  // ended meanwhile
  if (found->second.ended) return unsubscribe(full_name);
  return ask(proto::encode(found->second.request),
             [this, full_name](const proto::Payload& answer) { on_subscribed(full_name, answer); });
}

bool Declarations::unsubscribe(const std::string& full_name) {
  return ask(proto::encode(proto::ns::Unsubscribe{full_name}),
             [this, full_name](const proto::Payload& payload) {
               if (is_gone(proto::decode_answer<proto::ns::UnsubscribeAnswer>(payload)))
                 finish_subscription(full_name);
             });
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
}

bool Declarations::is_subscribed(GroupId group) const {
  return std::ranges::any_of(subscriptions_,
                             [&](const auto& entry) { return entry.second.group == group; });
}

void Declarations::on_subscribed(const std::string& full_name, const proto::Payload& payload) {
  const auto answer = proto::decode_answer<proto::ns::SubscribeAnswer>(payload);
  const auto now = answer ? *answer : proto::ns::SubscribeAnswer{};
  {
    const MutexLock lock(mutex_);
    const auto found = subscriptions_.find(full_name);
    if (found == subscriptions_.end()) return;
    Subscription& known = found->second;
    const GroupId former = std::exchange(known.group, now.group);
    // A hub that began anew may give another program the same group.
    bool changed = former != now.group;
    changed |= known.take_provider(now);
    // An event may have overtaken the answer from which `away` was known.
    changed |= now.direction == proto::ns::Direction::accepts;
    // Also that the hub takes it again: a program that was told of the refusal has to know.
    changed |= std::exchange(known.refused, !answer) == answer.has_value();
    // Requests of the program in between may never have left.
    if (known.ended) subscriptions_due_.push_back(full_name);
    // Its SERVICE_MOVED was lost with the connection, and the id may be of another one now.
    if (former != now.group && !is_subscribed(former)) credits_.forget(former);
    if (known.ended || !changed) return;
  }
  Record* record = make_event(NIF_SERVICE_MOVED, full_name);
  if (answer) {
    put_service(record->incoming, *answer);
  } else {
    add_refusal(*record, answer.error());
  }
  events_.push_back(item_of(record, full_name.size()));
}

bool Declarations::may_wait(GroupId group, std::size_t bytes) {
  // A count that is a moment old is good enough: what came before the program asked may wait.
  if (subscribing_.load(std::memory_order_relaxed) == 0) {
    unknown_bytes_ = 0;
    return true;
  }
  const MutexLock lock(mutex_);
  if (answered_.contains(group.value()) || is_subscribed(group)) return true;
  if (bytes > kUnknownBytesMax - unknown_bytes_) {
    ++unknown_lost_;
    return false;
  }
  unknown_bytes_ += bytes;
  return true;
}

std::vector<Item> Declarations::take_events() {
  if (unknown_lost_ != 0 && subscribing_.load(std::memory_order_relaxed) == 0)  // as in may_wait()
    add_gap(std::exchange(unknown_lost_, 0), proto::DropReason::no_subscriber);
  return std::exchange(events_, {});
}

}  // namespace gimnet::nif
