#include <algorithm>

#include "hub/control/state/services.hpp"
#include "proto/control/ns.hpp"

// Gives names their group ids and providers, takes them away, and tells those who follow them.

namespace gimnet::hub {
namespace {
using proto::ns::ChangeKind;
using std::chrono::milliseconds;
}  // namespace

ServiceNoted Services::service_noted(ChangeKind kind, const Topic& topic) {
  return {kind, topic.service->group, topic.service->provider, std::string{topic.full_name}};
}

std::optional<GroupIndex> Services::take_group(milliseconds now, Effects& effects) {
  constexpr std::uint32_t kHeldMost = kIndexMost / 4 * 3;
  while (group_indices_.held() >= kHeldMost && !orphans_.empty())
    give_back(*orphans_.begin()->second, now, effects);
  const std::optional<std::uint32_t> index = group_indices_.take(now);
  if (group_indices_.keeping_due(now)) effects.emplace_back(StateDue{});
  return index ? std::optional{GroupIndex{*index}} : std::nullopt;
}

/// A name has a group that it had not before: a new name, or other terms.
void Services::enter_group(Topic& topic, const LocalService& service, milliseconds now,
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
void Services::begin_away(Topic& topic, const AwayService& away, Effects& effects) {
  topic.away = away;
  away_[away.group] = &topic;
  effects.emplace_back(AwayGroupChanged{away.group});
}

void Services::end_away(Topic& topic, Effects& effects) {
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
void Services::take_over(Topic& topic, NodeIndex provider, const ServiceTerms& terms,
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
void Services::end_provision(Topic& topic, milliseconds now, Effects& effects) {
  const ServiceNoted noted = service_noted(ChangeKind::withdrawn, topic);
  topic.service->provider = kNobody;
  topic.orphan = ++orphaned_;
  orphans_[topic.orphan] = &topic;
  effects.emplace_back(GroupChanged{noted.group});
  if (topic.service->terms.retain)
    effects.emplace_back(RetainedDropped{noted.provider, noted.group});
  tell_subscribers(topic, effects);
  effects.emplace_back(noted);
  note_if_unused(topic, now);
}

void Services::leave_group(Topic& topic, milliseconds now, Effects& effects) {
  const GroupIndex group = topic.service->group;
  note_use(topic);
  for (const NodeIndex subscriber : topic.subscribers) {
    if (topic.pace_of(subscriber))
      effects.emplace_back(PaceEnded{subscriber, make_id(hub_, group)});
  }
  topic.once_plain.clear();
  topic.once_paced.clear();
  topic.service.reset();
  topic.links = 0;
  groups_.erase(group);
  group_indices_.give_back(group.value(), now);
  effects.emplace_back(GroupChanged{group});
}

/// REQUIRES: nobody provides it.
void Services::give_back(Topic& topic, milliseconds now, Effects& effects) {
  leave_group(topic, now, effects);
  tell_subscribers(topic, effects);
  forget_if_unused(topic);
}

void Services::note_use(Topic& topic) {
  orphans_.erase(topic.orphan);
  topic.orphan = topic.unused = 0;
}

void Services::note_if_unused(Topic& topic, milliseconds now) {
  if (topic.provided() || !topic.subscribers.empty()) return;
  topic.unused = ++orphaned_;
  unused_.add({now + milliseconds{limits_.grace_ms}, topic.service->group, topic.unused},
              orphans_.size(), [this](const Unused& note) { return is_void(note); });
}

bool Services::is_void(const Unused& note) const {
  const Topic* topic = find_group(note.group);
  return topic == nullptr || topic->unused != note.since;
}

void Services::tick(milliseconds now, Effects& effects) {
  for (; !unused_.empty() && unused_.front().until <= now; unused_.pop_front()) {
    if (!is_void(unused_.front())) give_back(*groups_.at(unused_.front().group), now, effects);
  }
}

std::optional<milliseconds> Services::next_deadline() const {
  return unused_.empty() ? std::nullopt : std::optional{unused_.front().until};
}

void Services::begin_pace(const Topic& topic, NodeIndex subscriber, Effects& effects) const {
  if (topic.pace_of(subscriber)) effects.emplace_back(PaceDue{subscriber, *topic.group(hub_)});
}

void Services::tell_subscribers(Topic& topic, Effects& effects, bool joins) {
  if (topic.subscribers.empty()) return;
  topic.change = ++changes_;
  effects.emplace_back(ServiceChanged{std::string{topic.full_name}, joins});
}

/// Another hub's service replaces a group of this hub that nobody provides. A group id that two
/// names claim belongs to the first one.
void Services::note_moved(std::string_view full_name, const std::optional<AwayService>& away,
                          milliseconds now, Effects& effects) {
  const auto found = topics_.find(full_name);
  if (found == topics_.end() || found->second.provided()) return;
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

void Services::set_links(GroupIndex group, std::uint32_t links, Effects& effects) {
  const auto found = groups_.find(group);
  if (found == groups_.end() || found->second->links == links) return;
  found->second->links = links;
  effects.emplace_back(SubscribersChanged{std::string{found->second->full_name}});
}

std::vector<const Topic*> Services::moved_since(NodeIndex node, std::uint64_t change) const {
  std::vector<const Topic*> moved;
  const auto found = nodes_.find(node);
  if (found == nodes_.end()) return moved;
  for (const Declared& declared : found->second.subscribes) {
    if (declared.topic->change > change) moved.push_back(declared.topic);
  }
  std::ranges::sort(moved, {}, &Topic::change);
  return moved;
}

std::vector<const Topic*> Services::provided_by(NodeIndex node) const {
  std::vector<const Topic*> provided;
  const auto found = nodes_.find(node);
  if (found == nodes_.end()) return provided;
  for (const Declared& declared : found->second.provides) provided.push_back(declared.topic);
  return provided;
}

}  // namespace gimnet::hub
