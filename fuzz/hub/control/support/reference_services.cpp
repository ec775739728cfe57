#include <algorithm>
#include <cmath>

#include "fuzz/hub/control/support/reference.hpp"
#include "fuzz/support/fuzz_input.hpp"
#include "proto/control/names.hpp"

// Services and subscriptions of the reference.

namespace gimnet::fuzz {

using proto::Status;
using proto::ns::ChangeKind;
namespace ns = proto::ns;

namespace {

std::uint32_t window_of(const ns::Advertise& terms) {
  return terms.delivery == ns::Delivery::sync ? std::max(1u, terms.window) : 0;
}

/// Do subscribers that know the one understand the other?
bool same_stream(const ns::Advertise& a, const ns::Advertise& b) {
  return a.message_type == b.message_type && a.instance == b.instance &&
         a.direction == b.direction && a.delivery == b.delivery && window_of(a) == window_of(b) &&
         a.retain == b.retain;
}

/// Does the one say exactly what the other says?
bool same_terms(const ns::Advertise& a, const ns::Advertise& b) {
  return same_stream(a, b) && a.metadata == b.metadata;
}

/// An index of this hub, as a request names it; 0: of another one.
template <class Id>
std::uint32_t own_index(Id id) {
  return hub_of(id) == ControlHub::kHub || hub_of(id) == kOwnHub ? index_of(id) : 0;
}

}  // namespace

std::optional<Reference::Terms> Reference::pace_of(const Topic& topic,
                                                   std::uint64_t subscriber) const {
  if (!topic.service) return std::nullopt;
  Terms terms = topic.subscribers.at(subscriber);
  const std::uint32_t most = window_of(topic.service->terms);
  terms.window = terms.window == 0 ? most : std::min(terms.window, most);
  const bool bounded = terms.window != 0 || terms.interval_us != 0 || topic.service->terms.retain;
  // Who was paced stays so, without bounds: what is held for it goes before what comes.
  if (!bounded && !topic.once_paced.contains(subscriber)) return std::nullopt;
  return terms;
}

void Reference::forget_if_unused(const std::string& full_name) {
  const auto found = topics_.find(full_name);
  if (!found->second.service && found->second.subscribers.empty()) topics_.erase(found);
}

void Reference::tell_moved(const std::string& full_name, std::uint32_t old_group,
                           std::uint32_t new_group, const ns::Advertise& terms) {
  const Topic& topic = topics_.at(full_name);
  for (const auto& [subscriber, asked] : topic.subscribers) {
    ns::ServiceMoved event;
    event.name = full_name;
    event.old_group = old_group == 0 ? GroupId{} : group_id(old_group);
    event.new_group = new_group == 0 ? GroupId{} : group_id(new_group);
    event.message_type = terms.message_type;
    event.instance = terms.instance;
    event.delivery = terms.delivery;
    event.retain = terms.retain;
    event.direction = terms.direction;
    if (const auto pace = new_group != 0 ? pace_of(topic, subscriber) : std::nullopt)
      event.window = pace->window;
    const proto::Payload bytes = proto::encode(event);
    due_.emplace_back(subscriber, ns::ServiceMoved::kOperation,
                      std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()),
                      old_group, new_group, 0);
  }
}

void Reference::tell_provider(const std::string& full_name, std::uint32_t subscriber, bool joined,
                              std::size_t count) {
  const std::optional<Service>& service = topics_.at(full_name).service;
  if (!service) return;
  const std::uint16_t operation =
      joined ? ns::SubscriberJoined::kOperation : ns::SubscriberLeft::kOperation;
  due_.emplace_back(service->provider, operation, std::string{}, service->group, 0, subscriber);
  counts_.emplace_back(service->provider, service->group, static_cast<std::uint32_t>(count));
}

void Reference::unsubscribe(std::uint64_t id, const std::string& full_name) {
  Topic& topic = topics_.at(full_name);
  topic.subscribers.erase(id);
  topic.once_plain.erase(id);
  topic.once_paced.erase(id);
  Session& session = sessions_.at(id);
  session.subscribes.erase(full_name);
  tell_provider(full_name, session.index, false, topic.subscribers.size());
  forget_if_unused(full_name);
}

/// The group goes, and with it what is kept of it.
void Reference::leave_group(const std::string& full_name, milliseconds now) {
  Topic& topic = topics_.at(full_name);
  const Service& service = *topic.service;
  groups_.erase(service.group);
  resting_groups_[service.group] = rests_until(now);
  note_service(ChangeKind::withdrawn, service.group, full_name);
  if (service.terms.retain) dropped_.emplace_back(service.group, service.provider);
}

void Reference::withdraw(const std::string& full_name, milliseconds now) {
  leave_group(full_name, now);
  Topic& topic = topics_.at(full_name);
  const Service old = *topic.service;
  topic.service.reset();
  sessions_.at(old.provider).provides.erase(full_name);
  tell_moved(full_name, old.group, 0, old.terms);
  forget_if_unused(full_name);
}

Status Reference::judge_terms(const Asked& asked, const ns::Advertise& offer) const {
  if (asked.session.name.empty() || !proto::valid_service_name(offer.service))
    return Status::bad_request;
  const bool counted = offer.delivery == ns::Delivery::sync;
  if (offer.direction == ns::Direction::accepts && (counted || offer.retain))
    return Status::bad_request;
  if (!counted && offer.window != 0) return Status::bad_request;
  if (!counted || offer.window <= limits_.sync_window) return Status::done;
  // What stands is not held to a limit that was lowered meanwhile.
  const auto topic = topics_.find(proto::join_service_name(asked.session.name, offer.service));
  const bool provided = topic != topics_.end() && topic->second.service &&
                        topic->second.service->provider == asked.id;
  const bool stands = provided && topic->second.service->terms.delivery == ns::Delivery::sync &&
                      topic->second.service->terms.window == offer.window;
  return stands ? Status::done : Status::bad_request;
}

bool Reference::terms_fit(const Asked& asked, const ns::Subscribe& wanted) const {
  const double rate = wanted.rate_hz;
  const bool has_rate = rate >= 0.001 && rate <= 1e6;
  if (wanted.depth < 1 || (rate != 0.0 && !has_rate)) return false;
  Terms stands{0, 0, 0};
  if (asked.session.subscribes.contains(wanted.name))
    stands = topics_.at(wanted.name).subscribers.at(asked.id);
  const bool rate_fits = rate <= static_cast<double>(limits_.subscription_rate_hz) ||
                         stands.interval_us == static_cast<std::uint32_t>(std::ceil(1e6 / rate));
  return (wanted.window <= limits_.sync_window || wanted.window == stands.window) &&
         (wanted.depth <= limits_.subscription_depth || wanted.depth == stands.depth) && rate_fits;
}

Status Reference::judge_offer(const Asked& asked, const ns::Advertise& offer) {
  if (const Status status = judge_terms(asked, offer); status != Status::done) return status;
  const std::string full_name = proto::join_service_name(asked.session.name, offer.service);
  const auto topic = topics_.find(full_name);
  const bool provided = topic != topics_.end() && topic->second.service.has_value();
  // Names of nodes are unique, so that nobody else can provide it.
  if (provided) FUZZ_MUST(topic->second.service->provider == asked.id);
  const bool said_before = provided && same_terms(topic->second.service->terms, offer);
  if (!said_before && !may_declare(asked)) return Status::rate;
  if (!proto::valid_name(full_name)) return Status::bad_request;
  if (!provided && asked.session.provides.size() >= limits_.services_per_node) return Status::limit;
  return Status::done;
}

void Reference::on_advertise(const Asked& asked) {
  const auto offer = proto::decode<ns::Advertise>(asked.payload);
  const Status status = offer ? judge_offer(asked, *offer) : Status::bad_request;
  require_status(asked.answer, status);
  if (status != Status::done) return;
  const std::string full_name = proto::join_service_name(asked.session.name, offer->service);
  Topic& topic = topics_[full_name];
  const auto answer = proto::decode_answer<ns::AdvertiseAnswer>(asked.answer);
  FUZZ_MUST(answer && answer->subscribers == topic.subscribers.size());
  FUZZ_MUST(hub_of(answer->group) == ControlHub::kHub);
  note_proof(index_of(answer->group), full_name, answer->proof);
  asked.session.provides[full_name] = asked.session.life;
  if (!topic.service || !same_stream(topic.service->terms, *offer)) {
    return open_group(asked, full_name, index_of(answer->group), *offer);
  }
  FUZZ_MUST(index_of(answer->group) == topic.service->group);
  if (topic.service->terms.metadata != offer->metadata) {
    note_service(ChangeKind::changed, topic.service->group, full_name);
  }
  topic.service->terms = *offer;
}

void Reference::note_proof(std::uint32_t group, const std::string& full_name,
                           const std::vector<std::byte>& proof) {
  FUZZ_MUST(!proof.empty());
  // No two services have the same, nor one for two groups; one for the same group has, as nothing
  // is forgotten here.
  const auto [given, fresh] = proofs_.try_emplace(proof, group, full_name);
  FUZZ_MUST(fresh || given->second == std::pair(group, full_name));
  latest_proofs_[group] = latest_proof_ = proof;
}

bool Reference::is_proven(const std::string& full_name, const ns::Advertise& terms) const {
  const auto given = proofs_.find(terms.former_proof);
  return given != proofs_.end() &&
         given->second == std::pair(own_index(terms.former_group), full_name);
}

void Reference::open_group(const Asked& asked, const std::string& full_name, std::uint32_t group,
                           const ns::Advertise& terms) {
  const auto free = [&](std::uint32_t index) {
    return index != 0 && index < kEveryIndex && !groups_.contains(index) &&
           is_free(resting_groups_, index, asked.hub.now);
  };
  Topic& topic = topics_.at(full_name);
  const std::uint32_t former = own_index(terms.former_group);
  const bool back = !topic.service && free(former) && is_proven(full_name, terms);
  if (back) FUZZ_MUST(group == former);
  FUZZ_MUST(free(group) && (back || !groups_given_.contains(group)));
  const std::uint32_t old_group = topic.service ? topic.service->group : 0;
  if (old_group != 0) leave_group(full_name, asked.hub.now);
  topic.service = Service{group, asked.id, terms};
  topic.once_plain.clear();
  topic.once_paced.clear();
  groups_[group] = full_name;
  groups_given_.insert(group);
  note_service(ChangeKind::advertised, group, full_name);
  tell_moved(full_name, old_group, group, terms);
}

void Reference::on_withdraw(const Asked& asked) {
  const auto wanted = proto::decode<ns::Withdraw>(asked.payload);
  if (!wanted) return require_status(asked.answer, Status::bad_request);
  const auto found = groups_.find(own_index(wanted->group));
  if (found == groups_.end()) return require_status(asked.answer, Status::not_found);
  const std::string full_name = found->second;
  const bool own = topics_.at(full_name).service->provider == asked.id;
  require_status(asked.answer, own ? Status::done : Status::denied);
  if (own) withdraw(full_name, asked.hub.now);
}

void Reference::on_subscribe(const Asked& asked) {
  const auto wanted = proto::decode<ns::Subscribe>(asked.payload);
  if (!wanted) return require_status(asked.answer, Status::bad_request);
  const double rate = wanted->rate_hz;
  if (!terms_fit(asked, *wanted)) return require_status(asked.answer, Status::bad_request);
  Session& session = asked.session;
  const Terms wants{wanted->window, wanted->depth,
                    rate == 0.0 ? 0 : static_cast<std::uint32_t>(std::ceil(1e6 / rate))};
  const bool fresh = !session.subscribes.contains(wanted->name);
  const bool said_before = !fresh && topics_.at(wanted->name).subscribers.at(asked.id) == wants;
  if (!said_before && !may_declare(asked)) return require_status(asked.answer, Status::rate);
  if (!proto::valid_name(wanted->name)) return require_status(asked.answer, Status::bad_request);
  if (fresh && session.subscribes.size() >= limits_.subscriptions_per_node) {
    return require_status(asked.answer, Status::limit);
  }
  require_status(asked.answer, Status::done);
  session.subscribes[wanted->name] = session.life;
  Topic& topic = topics_[wanted->name];
  const bool was_paced = !fresh && pace_of(topic, asked.id);
  topic.subscribers[asked.id] = wants;
  if (was_paced && !pace_of(topic, asked.id)) topic.once_paced.insert(asked.id);
  if (!fresh && topic.service && !was_paced && pace_of(topic, asked.id))
    topic.once_plain.insert(asked.id);
  if (fresh) tell_provider(wanted->name, session.index, true, topic.subscribers.size());
  const auto answer = proto::decode_answer<ns::SubscribeAnswer>(asked.answer);
  FUZZ_MUST(answer.has_value());
  ns::SubscribeAnswer due;
  if (topic.service) {
    const ns::Advertise& offer = topic.service->terms;
    due.group = group_id(topic.service->group);
    due.message_type = offer.message_type;
    due.instance = offer.instance;
    due.delivery = offer.delivery;
    due.retain = offer.retain;
    due.direction = offer.direction;
    if (const auto pace = pace_of(topic, asked.id)) due.window = pace->window;
  }
  FUZZ_MUST(*answer == due);
}

void Reference::on_unsubscribe(const Asked& asked) {
  const auto wanted = proto::decode<ns::Unsubscribe>(asked.payload);
  if (!wanted) return require_status(asked.answer, Status::bad_request);
  const bool known = asked.session.subscribes.contains(wanted->name);
  require_status(asked.answer, known ? Status::done : Status::not_found);
  if (known) unsubscribe(asked.id, wanted->name);
}

}  // namespace gimnet::fuzz
