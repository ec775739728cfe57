#include <algorithm>

#include "hub/control/state/services.hpp"
#include "proto/control/ns.hpp"

// How names get group ids and providers, and lose them, and who hears of it.

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
void Services::enter_group(Topic& topic, const Service& service, milliseconds now,
                           Effects& effects) {
  const std::optional<Service> former = topic.service;
  if (topic.provided()) effects.emplace_back(service_noted(ChangeKind::withdrawn, topic));
  if (former) leave_group(topic, now, effects);
  if (former && former->terms.retain && former->provider != kNobody)
    effects.emplace_back(RetainedDropped{former->provider, former->group});
  topic.service = service;
  groups_[service.group] = &topic;
  // Who is told may send at once to a group that accepts data.
  effects.emplace_back(GroupChanged{service.group});
  tell_subscribers(topic, effects, true);
  effects.emplace_back(service_noted(ChangeKind::advertised, topic));
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
    if (topic.pace_of(subscriber)) effects.emplace_back(PaceEnded{subscriber, group});
  }
  topic.once_plain.clear();
  topic.once_paced.clear();
  topic.service.reset();
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

void Services::begin_pace(const Topic& topic, NodeIndex subscriber, Effects& effects) {
  if (topic.pace_of(subscriber)) effects.emplace_back(PaceDue{subscriber, topic.service->group});
}

void Services::tell_subscribers(Topic& topic, Effects& effects, bool joins) {
  if (topic.subscribers.empty()) return;
  topic.change = ++changes_;
  effects.emplace_back(ServiceMoved{std::string{topic.full_name}, joins});
}

void Services::note_moved(std::string_view full_name, Effects& effects) {
  const auto found = topics_.find(full_name);
  if (found != topics_.end() && !found->second.provided()) tell_subscribers(found->second, effects);
}

void Services::note_all_moved(Effects& effects) {
  for (auto& [name, topic] : topics_) {
    if (!topic.provided()) tell_subscribers(topic, effects);
  }
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
