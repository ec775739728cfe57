#include "hub/control/state/services.hpp"

#include <algorithm>

#include "proto/control/ns.hpp"

// How services come under groups and leave them, and who hears of it.

namespace gimnet::hub {
namespace {

using proto::ns::ChangeKind;
using std::chrono::milliseconds;

static_assert(UntoldMoves::kBetweenMax == proto::ns::kGroupsBetweenMax);

ServiceMovedDue moved(const Topic& topic, const Service& service, GroupIndex old_group,
                      GroupIndex new_group) {
  ServiceMovedDue event;
  event.full_name = std::string{topic.full_name};
  event.old_group = old_group;
  event.new_group = new_group;
  event.message_type = service.terms.message_type;
  event.instance = service.terms.instance;
  event.delivery = service.terms.delivery;
  event.retain = service.terms.retain;
  event.direction = service.terms.direction;
  return event;
}

}  // namespace

ServiceNoted Services::service_noted(ChangeKind kind, const Topic& topic) {
  return {kind, topic.service->group, topic.service->provider, std::string{topic.full_name}};
}

void Services::open_group(Topic& topic, const Service& service, GroupIndex old_group,
                          Effects& effects) {
  topic.service = service;
  topic.once_plain.clear();
  topic.once_paced.clear();
  groups_[service.group] = &topic;
  if (old_group != kNoGroup) {
    effects.emplace_back(ServiceNoted{ChangeKind::withdrawn, old_group, service.provider,
                                      std::string{topic.full_name}});
  }
  // Who is told may send at once to a group that accepts data; of one that provides, messages come
  // at once to whoever may have to be told.
  const bool accepts = service.terms.direction == proto::ns::Direction::accepts;
  if (accepts) effects.emplace_back(GroupChanged{service.group});
  tell_subscribers(topic, moved(topic, service, old_group, service.group), effects);
  if (!accepts) effects.emplace_back(GroupChanged{service.group});
  for (const NodeIndex subscriber : topic.subscribers) begin_pace(topic, subscriber, effects);
  effects.emplace_back(service_noted(ChangeKind::advertised, topic));
}

void Services::begin_pace(const Topic& topic, NodeIndex subscriber, Effects& effects) {
  const std::optional<SubscriberTerms> pace = topic.pace_of(subscriber);
  if (!pace) return;
  effects.emplace_back(PaceDue{subscriber, topic.service->group, *pace, topic.service->terms.retain,
                               topic.once_plain.contains(subscriber)});
}

/// The topic's group is gone. First from the table: a frame that is read before the provider's
/// shard forgets the last message would make it anew, for ever.
void Services::end_group(const Topic& topic, Effects& effects) {
  const Service& service = *topic.service;
  effects.emplace_back(GroupChanged{service.group});
  for (const NodeIndex subscriber : topic.subscribers) {
    if (topic.pace_of(subscriber)) effects.emplace_back(PaceEnded{subscriber, service.group, true});
  }
  if (service.terms.retain) effects.emplace_back(RetainedDropped{service.provider, service.group});
}

void Services::close_group(Topic& topic, milliseconds now, Effects& effects) {
  const Service service = *topic.service;
  end_group(topic, effects);
  topic.service.reset();
  groups_.erase(service.group);
  group_indices_.give_back(service.group.value(), now);
  tell_subscribers(topic, moved(topic, service, service.group, kNoGroup), effects);
  effects.emplace_back(ServiceNoted{ChangeKind::withdrawn, service.group, service.provider,
                                    std::string{topic.full_name}});
}

void Services::tell_subscribers(Topic& topic, ServiceMovedDue event, Effects& effects) {
  event.move = ++moves_;
  std::map<std::uint32_t, std::vector<NodeIndex>> by_window;
  for (const NodeIndex subscriber : topic.subscribers)
    by_window[window_of(topic, subscriber)].push_back(subscriber);
  for (auto& [window, subscribers] : by_window) {
    event.subscribers = std::move(subscribers);
    event.window = window;
    effects.emplace_back(event);
  }
  topic.untold.on_moved(topic.subscribers, event.old_group, event.move);
}

std::uint32_t Services::window_of(const Topic& topic, NodeIndex subscriber) {
  const std::optional<SubscriberTerms> pace = topic.pace_of(subscriber);
  return pace ? pace->window : 0;
}

std::vector<ServiceMovedDue> Services::untold_moves(NodeIndex node) const {
  std::vector<ServiceMovedDue> events;
  const auto found = nodes_.find(node);
  if (found == nodes_.end()) return events;
  for (const Declared& declared : found->second.subscribes) {
    const Topic& topic = *declared.topic;
    const std::optional<UntoldMoves::Untold> untold = topic.untold.of(node);
    if (!untold) continue;
    // An id that was given back may be another service's by now, and would be taken from that.
    const auto is_another = [&](GroupIndex group) { return groups_.contains(group); };
    ServiceMovedDue event;
    if (topic.service) event = moved(topic, *topic.service, kNoGroup, topic.service->group);
    event.full_name = std::string{topic.full_name};
    event.old_group = is_another(untold->known) ? kNoGroup : untold->known;
    event.subscribers = {node};
    event.window = window_of(topic, node);
    event.move = untold->move;
    event.again = true;
    for (const GroupIndex group : untold->between) {
      if (!is_another(group)) event.between.push_back(group);
    }
    events.push_back(std::move(event));
  }
  return events;
}

void Services::moves_read(NodeIndex node, std::uint64_t move) {
  const auto found = nodes_.find(node);
  if (found == nodes_.end()) return;
  for (const Declared& declared : found->second.subscribes)
    declared.topic->untold.on_read(node, move);
}

}  // namespace gimnet::hub
