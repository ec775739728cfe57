#include "hub/control/state/services.hpp"

#include <algorithm>

#include "base/check.hpp"
#include "base/id_text.hpp"
#include "proto/control/names.hpp"
#include "proto/control/ns.hpp"

namespace gimnet::hub {
namespace {

using proto::Status;
using proto::ns::ChangeKind;
using std::chrono::milliseconds;

template <class List>
auto find_topic(List& list, const Topic& topic) {
  return std::find_if(list.begin(), list.end(),
                      [&topic](const auto& entry) { return entry.topic == &topic; });
}

/// Do subscribers that know the one understand the other?
bool same_stream(const ServiceTerms& a, const ServiceTerms& b) {
  return a.message_type == b.message_type && a.instance == b.instance &&
         a.direction == b.direction && a.delivery == b.delivery && a.window == b.window &&
         a.retain == b.retain;
}

proto::Refusal bad_name(const char* fault) {
  return proto::Refusal{Status::bad_request,
                        std::string{"the full name of a service cannot be that: "} + fault};
}

proto::Refusal limit_reached(std::string_view what, std::uint64_t limit, std::string_view name) {
  return proto::Refusal{Status::limit,
                        "a node may have " + std::to_string(limit) + " " + std::string{what} +
                            "; end one first, or start the hub with a larger --limit " +
                            std::string{name}};
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

Services::Services(HubId hub, const Limits& limits, const IndexRange& groups)
    : hub_(hub), limits_(limits), group_indices_(kIndexMost, index_resting_time(limits), groups) {}

Result<Services::Advertised, proto::Refusal> Services::advertise(NodeIndex provider,
                                                                 std::string_view full_name,
                                                                 const ServiceTerms& terms,
                                                                 milliseconds now,
                                                                 Effects& effects) {
  if (const char* fault = proto::name_fault(full_name)) return bad_name(fault);
  const auto known = topics_.find(full_name);
  const bool provided = known != topics_.end() && known->second.provided();
  if (provided && known->second.service->provider != provider) {
    return proto::Refusal{Status::taken,
                          "the service '" + std::string{full_name} + "' is provided by node " +
                              to_string(make_id(hub_, known->second.service->provider)) +
                              "; choose another name"};
  }
  Node& node = nodes_[provider];
  if (!provided && node.provides.size() >= limits_.services_per_node) {
    forget_if_idle(provider);
    return limit_reached("services", limits_.services_per_node, "services_per_node");
  }
  if (provided) find_topic(node.provides, known->second)->life = node.life;
  const bool keeps_group = known != topics_.end() && known->second.service &&
                           same_stream(known->second.service->terms, terms);
  std::optional<GroupIndex> group;
  if (!keeps_group && !(group = take_group(now, effects))) {
    forget_if_idle(provider);
    return proto::Refusal{Status::limit, group_indices_.shortage("group ids", now)};
  }
  Topic& entry = topic(full_name);  // not before: a topic may have gone for its group
  if (group) {
    enter_group(entry, LocalService{*group, provider, terms}, now, effects);
  } else if (!provided) {
    take_over(entry, provider, terms, effects);
  } else if (entry.service->terms.metadata != terms.metadata) {
    entry.service->terms.metadata = terms.metadata;
    effects.emplace_back(service_noted(ChangeKind::changed, entry));
  }
  if (!provided) node.provides.push_back({&entry, node.life});
  return Advertised{entry.service->group, entry.subscriber_count()};
}

std::optional<proto::Refusal> Services::withdraw(NodeIndex provider, GroupIndex group,
                                                 milliseconds now, Effects& effects) {
  const auto found = groups_.find(group);
  if (found == groups_.end() || !found->second->provided()) {
    return proto::Refusal{Status::not_found,
                          "no service has the group " + to_string(make_id(hub_, group))};
  }
  Topic& entry = *found->second;
  if (entry.service->provider != provider) {
    return proto::Refusal{Status::denied, "the service '" + std::string{entry.full_name} +
                                              "' is provided by another node"};
  }
  Node& node = nodes_[provider];
  node.provides.erase(find_topic(node.provides, entry));
  end_provision(entry, now, effects);
  forget_if_idle(provider);
  return std::nullopt;
}

Result<const Topic*, proto::Refusal> Services::subscribe(NodeIndex node_index,
                                                         std::string_view full_name,
                                                         const SubscriberTerms& terms,
                                                         Effects& effects,
                                                         const std::optional<AwayService>& away) {
  if (const char* fault = proto::name_fault(full_name)) return bad_name(fault);
  Node& node = nodes_[node_index];
  const auto known = topics_.find(full_name);
  if (known != topics_.end()) {
    if (const auto old = find_topic(node.subscribes, known->second); old != node.subscribes.end()) {
      old->life = node.life;
      change_terms(known->second, node_index, terms, effects);
      return &known->second;
    }
  }
  if (node.subscribes.size() >= limits_.subscriptions_per_node) {
    forget_if_idle(node_index);
    return limit_reached("subscriptions", limits_.subscriptions_per_node, "subscriptions_per_node");
  }
  Topic& entry = topic(full_name);
  node.subscribes.push_back({&entry, node.life});
  auto& list = entry.subscribers;
  list.insert(std::lower_bound(list.begin(), list.end(), node_index), node_index);
  if (terms != SubscriberTerms{}) entry.terms[node_index] = terms;
  if (entry.service) {
    entry.unused = 0;
    effects.emplace_back(MemberChanged{make_id(hub_, entry.service->group), node_index});
    begin_pace(entry, node_index, effects);
    effects.emplace_back(SubscribersChanged{std::string{full_name}});
    return &entry;
  }
  const bool first = away && !entry.away && !away_.contains(away->group);
  if (first) begin_away(entry, *away, effects);
  if (entry.away) {
    if (!first) effects.emplace_back(AwayGroupChanged{entry.away->group});
    effects.emplace_back(MemberChanged{entry.away->group, node_index});
    begin_pace(entry, node_index, effects);
  }
  return &entry;
}

std::optional<proto::Refusal> Services::unsubscribe(NodeIndex node_index,
                                                    std::string_view full_name, milliseconds now,
                                                    Effects& effects) {
  const auto known = topics_.find(full_name);
  const auto node = nodes_.find(node_index);
  if (known != topics_.end() && node != nodes_.end()) {
    auto& list = node->second.subscribes;
    if (const auto declared = find_topic(list, known->second); declared != list.end()) {
      list.erase(declared);
      remove_subscriber(known->second, node_index, now, effects);
      forget_if_idle(node_index);
      return std::nullopt;
    }
  }
  return proto::Refusal{Status::not_found, "this node is not subscribed to that service"};
}

std::vector<Services::Declared> Services::take_undeclared(std::vector<Declared>& list,
                                                          std::uint32_t life) {
  std::vector<Declared> kept;
  std::vector<Declared> taken;
  for (const Declared& declared : list) (declared.life == life ? kept : taken).push_back(declared);
  list = std::move(kept);
  return taken;
}

void Services::node_returned(NodeIndex node) {
  if (const auto found = nodes_.find(node); found != nodes_.end()) ++found->second.life;
}

void Services::drop_undeclared(NodeIndex node_index, milliseconds now, Effects& effects) {
  const auto found = nodes_.find(node_index);
  if (found == nodes_.end()) return;
  Node& node = found->second;
  const std::vector<Declared> unsubscribed = take_undeclared(node.subscribes, node.life);
  const std::vector<Declared> closed = take_undeclared(node.provides, node.life);
  for (const Declared& declared : unsubscribed)
    remove_subscriber(*declared.topic, node_index, now, effects);
  for (const Declared& declared : closed) end_provision(*declared.topic, now, effects);
  forget_if_idle(node_index);
}

void Services::node_renamed(NodeIndex node_index, milliseconds now, Effects& effects) {
  const auto found = nodes_.find(node_index);
  if (found == nodes_.end()) return;
  const std::vector<Declared> provides = std::move(found->second.provides);
  found->second.provides.clear();
  for (const Declared& declared : provides) end_provision(*declared.topic, now, effects);
  forget_if_idle(node_index);
}

void Services::node_renumbered(NodeIndex node_index, NodeIndex new_index, Effects& effects) {
  auto node = nodes_.extract(node_index);
  if (node.empty()) return;
  node.key() = new_index;
  const Node& moved = nodes_.insert(std::move(node)).position->second;
  for (const Declared& declared : moved.provides) {
    declared.topic->service->provider = new_index;
    effects.emplace_back(GroupChanged{declared.topic->service->group});
    tell_subscribers(*declared.topic, effects);
    effects.emplace_back(service_noted(ChangeKind::changed, *declared.topic));
  }
  for (const Declared& declared : moved.subscribes) {
    Topic& entry = *declared.topic;
    auto& list = entry.subscribers;
    list.erase(std::lower_bound(list.begin(), list.end(), node_index));
    list.insert(std::lower_bound(list.begin(), list.end(), new_index), new_index);
    if (auto asked = entry.terms.extract(node_index)) {
      asked.key() = new_index;
      entry.terms.insert(std::move(asked));
    }
    for (auto* changed : {&entry.once_plain, &entry.once_paced}) {
      if (changed->erase(node_index) != 0) changed->insert(new_index);
    }
    // It may not have joined the group yet, and be passed over now that it stands elsewhere.
    if (!entry.group(hub_)) continue;
    effects.emplace_back(MemberChanged{*entry.group(hub_), new_index});
    begin_pace(entry, new_index, effects);
  }
}

void Services::node_left(NodeIndex node_index, milliseconds now, Effects& effects) {
  node_returned(node_index);
  drop_undeclared(node_index, now, effects);
}

const Topic* Services::find_group(GroupIndex group) const {
  const auto found = groups_.find(group);
  return found == groups_.end() ? nullptr : found->second;
}

const Topic* Services::find_group(GroupId group) const {
  if (hub_of(group) == hub_) return find_group(group_index_of(group));
  const auto found = away_.find(group);
  return found == away_.end() ? nullptr : found->second;
}

const ServiceTerms* Services::provided(NodeIndex node, std::string_view full_name) const {
  const auto known = topics_.find(full_name);
  if (known == topics_.end() || !known->second.provided() ||
      known->second.service->provider != node)
    return nullptr;
  return &known->second.service->terms;
}

std::optional<SubscriberTerms> Services::subscribed(NodeIndex node,
                                                    std::string_view full_name) const {
  const auto known = topics_.find(full_name);
  if (known == topics_.end() || !std::ranges::binary_search(known->second.subscribers, node))
    return std::nullopt;
  const auto asked = known->second.terms.find(node);
  return asked != known->second.terms.end() ? asked->second : SubscriberTerms{};
}

const Topic* Services::find(std::string_view full_name) const {
  const auto known = topics_.find(full_name);
  return known == topics_.end() ? nullptr : &known->second;
}

std::size_t Services::services_of(NodeIndex node) const {
  const auto found = nodes_.find(node);
  return found == nodes_.end() ? 0 : found->second.provides.size();
}

Topic& Services::topic(std::string_view full_name) {
  if (const auto found = topics_.find(full_name); found != topics_.end()) return found->second;
  const auto [added, fresh] = topics_.emplace(std::string{full_name}, Topic{});
  GIMNET_CHECK(fresh);
  added->second.full_name = added->first;
  return added->second;
}

void Services::forget_if_unused(Topic& topic) {
  if (topic.service || !topic.subscribers.empty()) return;
  if (topic.away) away_.erase(topic.away->group);
  topics_.erase(topics_.find(topic.full_name));
}

void Services::forget_if_idle(NodeIndex node) {
  const auto found = nodes_.find(node);
  if (found == nodes_.end()) return;
  if (found->second.provides.empty() && found->second.subscribes.empty()) nodes_.erase(found);
}

void Services::change_terms(Topic& topic, NodeIndex subscriber, const SubscriberTerms& terms,
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

void Services::forget_subscriber(Topic& topic, NodeIndex subscriber) {
  topic.terms.erase(subscriber);
  topic.once_plain.erase(subscriber);
  topic.once_paced.erase(subscriber);
}

void Services::remove_subscriber(Topic& topic, NodeIndex node, milliseconds now, Effects& effects) {
  auto& list = topic.subscribers;
  const auto place = std::lower_bound(list.begin(), list.end(), node);
  GIMNET_CHECK(place != list.end() && *place == node);
  const bool paced = topic.pace_of(node).has_value();
  forget_subscriber(topic, node);
  list.erase(place);
  if (topic.away) {
    effects.emplace_back(MemberChanged{topic.away->group, node});
    if (paced) effects.emplace_back(PaceEnded{node, topic.away->group});
    effects.emplace_back(AwayGroupChanged{topic.away->group});
  }
  if (topic.service) {
    const GroupId group = make_id(hub_, topic.service->group);
    effects.emplace_back(MemberChanged{group, node});
    if (paced) effects.emplace_back(PaceEnded{node, group});
    effects.emplace_back(SubscribersChanged{std::string{topic.full_name}});
    note_if_unused(topic, now);
  }
  forget_if_unused(topic);
}

}  // namespace gimnet::hub
