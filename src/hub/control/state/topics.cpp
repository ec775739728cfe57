#include "hub/control/state/topics.hpp"

#include <algorithm>

#include "base/check.hpp"
#include "proto/control/ns.hpp"

namespace gimnet::hub {
namespace {

using proto::ns::ChangeKind;
using std::chrono::milliseconds;

/// Do subscribers that know the one understand the other?
bool same_stream(const ServiceTerms& a, const ServiceTerms& b) {
  return a.message_type == b.message_type && a.instance == b.instance &&
         a.direction == b.direction && a.delivery == b.delivery && a.window == b.window &&
         a.retain == b.retain;
}

}  // namespace

std::optional<GroupId> Topic::group(HubId own) const {
  if (service) return make_id(own, service->group);
  return away ? std::optional{away->group} : std::nullopt;
}

std::optional<SubscriberTerms> Topic::pace_of(NodeIndex subscriber) const {
  if (!service && !away) return std::nullopt;
  const auto asked = terms.find(subscriber);
  SubscriberTerms pace = asked != terms.end() ? asked->second : SubscriberTerms{};
  std::uint32_t most = away ? away->window : 0;
  if (service && service->terms.delivery == proto::ns::Delivery::sync) most = service->terms.window;
  if (pace.window == 0 || (most != 0 && most < pace.window)) pace.window = most;
  const bool bounded = pace.window != 0 || pace.interval_us != 0 || retains();
  if (!bounded && !once_paced.contains(subscriber)) return std::nullopt;
  return pace;
}

Topics::Topics(HubId hub, const Limits& limits, const IndexRange& groups)
    : hub_(hub), limits_(limits), group_indices_(kIndexMost, index_resting_time(limits), groups) {}

Result<Topic*, proto::Refusal> Topics::provide(std::string_view full_name, NodeIndex provider,
                                               const ServiceTerms& terms, milliseconds now,
                                               Effects& effects) {
  const Topic* known = find(full_name);
  std::optional<GroupIndex> group;
  if (known == nullptr || !known->service || !same_stream(known->service->terms, terms)) {
    group = take_group(now, effects);
    if (!group)
      return proto::Refusal{proto::Status::limit, group_indices_.shortage("group ids", now)};
  }
  Topic& entry = topic(full_name);  // not before: a topic may have gone for its group
  if (group) {
    enter_group(entry, LocalService{*group, provider, terms}, now, effects);
  } else if (!entry.provided()) {
    take_over(entry, provider, terms, effects);
  } else if (entry.service->terms.metadata != terms.metadata) {
    entry.service->terms.metadata = terms.metadata;
    effects.emplace_back(service_noted(ChangeKind::changed, entry));
  }
  set_provider_away(entry, false, effects);
  return &entry;
}

/// A service that gives data needs none of it: nobody sends there.
void Topics::set_provider_away(Topic& topic, bool away, Effects& effects) {
  LocalService& service = *topic.service;
  if (service.terms.direction != proto::ns::Direction::accepts || service.provider_away == away)
    return;
  service.provider_away = away;
  tell_subscribers(topic, effects);
  effects.emplace_back(AcceptanceChanged{service.group});
}

void Topics::renumber_provider(Topic& topic, NodeIndex provider, Effects& effects) {
  topic.service->provider = provider;
  effects.emplace_back(GroupChanged{topic.service->group});
  tell_subscribers(topic, effects);
  effects.emplace_back(service_noted(ChangeKind::changed, topic));
}

Topic& Topics::add_subscriber(std::string_view full_name, NodeIndex subscriber,
                              const SubscriberTerms& terms, const std::optional<AwayService>& away,
                              Effects& effects) {
  Topic& entry = topic(full_name);
  auto& list = entry.subscribers;
  list.insert(std::lower_bound(list.begin(), list.end(), subscriber), subscriber);
  if (terms != SubscriberTerms{}) entry.terms[subscriber] = terms;
  if (entry.service) {
    entry.unused = 0;
    effects.emplace_back(MemberChanged{make_id(hub_, entry.service->group), subscriber});
    begin_pace(entry, subscriber, effects);
    effects.emplace_back(SubscribersChanged{std::string{full_name}});
    return entry;
  }
  const bool first = away && !entry.away && !away_.contains(away->group);
  if (first) begin_away(entry, *away, effects);
  if (entry.away) {
    if (!first) effects.emplace_back(AwayGroupChanged{entry.away->group});
    effects.emplace_back(MemberChanged{entry.away->group, subscriber});
    begin_pace(entry, subscriber, effects);
  }
  return entry;
}

void Topics::change_terms(Topic& topic, NodeIndex subscriber, const SubscriberTerms& terms,
                          Effects& effects) {
  const std::optional<SubscriberTerms> before = topic.pace_of(subscriber);
  topic.terms.erase(subscriber);
  if (terms != SubscriberTerms{}) topic.terms[subscriber] = terms;
  if (before && !topic.pace_of(subscriber)) topic.once_paced.insert(subscriber);
  const std::optional<SubscriberTerms> after = topic.pace_of(subscriber);
  if (topic.away) effects.emplace_back(AwayGroupChanged{topic.away->group});
  if (before == after) return;
  if (!before) {
    topic.once_plain.insert(subscriber);
    effects.emplace_back(MemberChanged{*topic.group(hub_), subscriber});
  }
  begin_pace(topic, subscriber, effects);
}

void Topics::remove_subscriber(Topic& topic, NodeIndex subscriber, milliseconds now,
                               Effects& effects) {
  auto& list = topic.subscribers;
  const auto place = std::lower_bound(list.begin(), list.end(), subscriber);
  GIMNET_CHECK(place != list.end() && *place == subscriber);
  const bool paced = topic.pace_of(subscriber).has_value();
  topic.terms.erase(subscriber);
  topic.once_plain.erase(subscriber);
  topic.once_paced.erase(subscriber);
  topic.missed.erase(subscriber);
  list.erase(place);
  if (topic.away) {
    effects.emplace_back(MemberChanged{topic.away->group, subscriber});
    if (paced) effects.emplace_back(PaceEnded{subscriber, topic.away->group});
    effects.emplace_back(AwayGroupChanged{topic.away->group});
  }
  if (topic.service) {
    const GroupId group = make_id(hub_, topic.service->group);
    effects.emplace_back(MemberChanged{group, subscriber});
    if (paced) effects.emplace_back(PaceEnded{subscriber, group});
    effects.emplace_back(SubscribersChanged{std::string{topic.full_name}});
    note_if_unused(topic, now);
  }
  forget_if_unused(topic);
}

void Topics::renumber_subscriber(Topic& topic, NodeIndex former, NodeIndex subscriber,
                                 Effects& effects) {
  auto& list = topic.subscribers;
  list.erase(std::lower_bound(list.begin(), list.end(), former));
  list.insert(std::lower_bound(list.begin(), list.end(), subscriber), subscriber);
  if (auto asked = topic.terms.extract(former)) {
    asked.key() = subscriber;
    topic.terms.insert(std::move(asked));
  }
  for (auto* changed : {&topic.once_plain, &topic.once_paced}) {
    if (changed->erase(former) != 0) changed->insert(subscriber);
  }
  if (auto told = topic.missed.extract(former)) {
    told.key() = subscriber;
    topic.missed.insert(std::move(told));
  }
  // It may not have joined the group yet, and be passed over now that it stands elsewhere.
  if (!topic.group(hub_)) return;
  effects.emplace_back(MemberChanged{*topic.group(hub_), subscriber});
  begin_pace(topic, subscriber, effects);
}

ServiceNoted Topics::service_noted(ChangeKind kind, const Topic& topic) {
  return {kind, topic.service->group, topic.service->provider, std::string{topic.full_name}};
}

std::optional<GroupIndex> Topics::take_group(milliseconds now, Effects& effects) {
  constexpr std::uint32_t kHeldMost = kIndexMost / 4 * 3;
  while (group_indices_.held() >= kHeldMost && !orphans_.empty())
    give_back(*orphans_.begin()->second, now, effects);
  const std::optional<std::uint32_t> index = group_indices_.take(now);
  if (group_indices_.keeping_due(now)) effects.emplace_back(StateDue{});
  return index ? std::optional{GroupIndex{*index}} : std::nullopt;
}

/// A name has a group that it had not before: a new name, or other terms.
void Topics::enter_group(Topic& topic, const LocalService& service, milliseconds now,
                         Effects& effects) {
  const std::optional<LocalService> former = topic.service;
  if (topic.away) end_away(topic, effects);
  if (topic.provided()) effects.emplace_back(service_noted(ChangeKind::withdrawn, topic));
  if (former) leave_group(topic, now, effects);
  if (former && former->terms.retain && former->provider != kNobody)
    effects.emplace_back(RetainedDropped{former->provider, former->group});
  topic.service = service;
  groups_[service.group] = &topic;
  // A node that is told may send at once to a group that accepts data.
  effects.emplace_back(GroupChanged{service.group});
  tell_subscribers(topic, effects, true);
  effects.emplace_back(service_noted(ChangeKind::advertised, topic));
}

/// Its subscribers get the messages of a group of another hub.
void Topics::begin_away(Topic& topic, const AwayService& away, Effects& effects) {
  topic.away = away;
  away_[away.group] = &topic;
  effects.emplace_back(AwayGroupChanged{away.group});
}

void Topics::end_away(Topic& topic, Effects& effects) {
  const GroupId group = topic.away->group;
  for (const NodeIndex subscriber : topic.subscribers) {
    if (topic.pace_of(subscriber)) effects.emplace_back(PaceEnded{subscriber, group});
  }
  topic.once_plain.clear();
  topic.once_paced.clear();
  topic.away.reset();
  away_.erase(group);
  effects.emplace_back(AwayGroupChanged{group});
}

/// Somebody provides what nobody did.
void Topics::take_over(Topic& topic, NodeIndex provider, const ServiceTerms& terms,
                       Effects& effects) {
  note_use(topic);
  topic.service->provider = provider;
  topic.service->terms.metadata = terms.metadata;
  effects.emplace_back(GroupChanged{topic.service->group});
  tell_subscribers(topic, effects);
  effects.emplace_back(service_noted(ChangeKind::advertised, topic));
}

/// First the table: a frame that is read before the provider's shard forgets the last message would
/// make it anew, for ever.
void Topics::end_provision(Topic& topic, milliseconds now, Effects& effects) {
  const ServiceNoted noted = service_noted(ChangeKind::withdrawn, topic);
  topic.service->provider = kNobody;
  topic.service->provider_away = false;
  topic.orphan = ++orphaned_;
  orphans_[topic.orphan] = &topic;
  effects.emplace_back(GroupChanged{noted.group});
  if (topic.service->terms.retain)
    effects.emplace_back(RetainedDropped{noted.provider, noted.group});
  tell_subscribers(topic, effects);
  effects.emplace_back(noted);
  note_if_unused(topic, now);
}

void Topics::leave_group(Topic& topic, milliseconds now, Effects& effects) {
  const GroupIndex group = topic.service->group;
  note_use(topic);
  for (const NodeIndex subscriber : topic.subscribers) {
    if (topic.pace_of(subscriber))
      effects.emplace_back(PaceEnded{subscriber, make_id(hub_, group)});
  }
  topic.once_plain.clear();
  topic.once_paced.clear();
  topic.service.reset();
  topic.afar = 0;
  groups_.erase(group);
  group_indices_.give_back(group.value(), now);
  effects.emplace_back(GroupChanged{group});
}

/// REQUIRES: nobody provides it.
void Topics::give_back(Topic& topic, milliseconds now, Effects& effects) {
  leave_group(topic, now, effects);
  tell_subscribers(topic, effects);
  forget_if_unused(topic);
}

void Topics::note_use(Topic& topic) {
  orphans_.erase(topic.orphan);
  topic.orphan = topic.unused = 0;
}

void Topics::note_if_unused(Topic& topic, milliseconds now) {
  if (topic.provided() || !topic.subscribers.empty()) return;
  topic.unused = ++orphaned_;
  unused_.add({now + milliseconds{limits_.grace_ms}, topic.service->group, topic.unused},
              orphans_.size(), [this](const Unused& note) { return is_void(note); });
}

bool Topics::is_void(const Unused& note) const {
  const Topic* topic = find_group(note.group);
  return topic == nullptr || topic->unused != note.since;
}

void Topics::tick(milliseconds now, Effects& effects) {
  for (; !unused_.empty() && unused_.front().until <= now; unused_.pop_front()) {
    if (!is_void(unused_.front())) give_back(*groups_.at(unused_.front().group), now, effects);
  }
}

std::optional<milliseconds> Topics::next_deadline() const {
  return unused_.empty() ? std::nullopt : std::optional{unused_.front().until};
}

void Topics::begin_pace(const Topic& topic, NodeIndex subscriber, Effects& effects) const {
  if (topic.pace_of(subscriber)) effects.emplace_back(PaceDue{subscriber, *topic.group(hub_)});
}

void Topics::tell_subscribers(Topic& topic, Effects& effects, bool joins) {
  if (topic.subscribers.empty()) return;
  topic.change = ++changes_;
  effects.emplace_back(ServiceChanged{std::string{topic.full_name}, joins});
}

/// Another hub's service replaces a group of this hub that nobody provides. A group id that two
/// names claim belongs to the first one.
void Topics::note_moved(std::string_view full_name, const std::optional<AwayService>& away,
                        milliseconds now, Effects& effects) {
  const auto found = by_name_.find(full_name);
  if (found == by_name_.end() || found->second.provided()) return;
  Topic& topic = found->second;
  if (topic.subscribers.empty()) {
    // Its next subscriber is to find the other hub's service.
    if (away && topic.service) give_back(topic, now, effects);
    return;
  }
  const auto held = away ? away_.find(away->group) : away_.end();
  const bool usable = away && (held == away_.end() || held->second == &topic);
  const auto same_stream = [&] {
    return away->group == topic.away->group && away->window == topic.away->window &&
           away->retain == topic.away->retain;
  };
  if (topic.away && usable && same_stream()) {
    topic.away = away;
    effects.emplace_back(AwayGroupChanged{away->group});
    return tell_subscribers(topic, effects);
  }
  if (topic.away) end_away(topic, effects);
  if (!usable) return tell_subscribers(topic, effects);
  if (topic.service) leave_group(topic, now, effects);
  begin_away(topic, *away, effects);
  tell_subscribers(topic, effects, true);
}

void Topics::set_afar(GroupIndex group, std::uint32_t subscribers, Effects& effects) {
  const auto found = groups_.find(group);
  if (found == groups_.end() || found->second->afar == subscribers) return;
  found->second->afar = subscribers;
  effects.emplace_back(SubscribersChanged{std::string{found->second->full_name}});
}

Topic* Topics::find(std::string_view full_name) {
  const auto known = by_name_.find(full_name);
  return known == by_name_.end() ? nullptr : &known->second;
}

const Topic* Topics::find(std::string_view full_name) const {
  const auto known = by_name_.find(full_name);
  return known == by_name_.end() ? nullptr : &known->second;
}

Topic* Topics::find_group(GroupIndex group) {
  const auto found = groups_.find(group);
  return found == groups_.end() ? nullptr : found->second;
}

const Topic* Topics::find_group(GroupIndex group) const {
  const auto found = groups_.find(group);
  return found == groups_.end() ? nullptr : found->second;
}

const Topic* Topics::find_group(GroupId group) const {
  if (hub_of(group) == hub_) return find_group(group_index_of(group));
  const auto found = away_.find(group);
  return found == away_.end() ? nullptr : found->second;
}

Topic& Topics::topic(std::string_view full_name) {
  if (const auto found = by_name_.find(full_name); found != by_name_.end()) return found->second;
  const auto [added, fresh] = by_name_.emplace(std::string{full_name}, Topic{});
  GIMNET_CHECK(fresh);
  added->second.full_name = added->first;
  return added->second;
}

void Topics::forget_if_unused(Topic& topic) {
  if (topic.service || !topic.subscribers.empty()) return;
  if (topic.away) away_.erase(topic.away->group);
  by_name_.erase(by_name_.find(topic.full_name));
}

}  // namespace gimnet::hub
