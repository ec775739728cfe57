#include "hub/control/state/services.hpp"

#include <algorithm>

#include "base/ids.hpp"
#include "proto/control/names.hpp"

namespace gimnet::hub {
namespace {

using proto::Status;
using std::chrono::milliseconds;

template <class List>
auto find_topic(List& list, const Topic& topic) {
  return std::find_if(list.begin(), list.end(),
                      [&topic](const auto& entry) { return entry.topic == &topic; });
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

Result<Services::Advertised, proto::Refusal> Services::advertise(NodeIndex provider,
                                                                 std::string_view full_name,
                                                                 const ServiceTerms& terms,
                                                                 milliseconds now,
                                                                 Effects& effects) {
  if (const char* fault = proto::name_fault(full_name)) return bad_name(fault);
  const Topic* known = topics_.find(full_name);
  const bool provided = known != nullptr && known->provided();
  if (provided && known->service->provider != provider) {
    return proto::Refusal{Status::taken,
                          "the service '" + std::string{full_name} + "' is provided by node " +
                              to_string(make_id(topics_.hub(), known->service->provider)) +
                              "; choose another name"};
  }
  Node& node = nodes_[provider];
  if (!provided && node.provides.size() >= limits_.services_per_node) {
    forget_if_idle(provider);
    return limit_reached("services", limits_.services_per_node, "services_per_node");
  }
  if (provided) find_topic(node.provides, *known)->life = node.life;
  const auto given = topics_.provide(full_name, provider, terms, now, effects);
  if (!given) {
    forget_if_idle(provider);
    return given.error();
  }
  Topic& topic = **given;
  if (!provided) node.provides.push_back({&topic, node.life});
  return Advertised{topic.service->group, topic.subscriber_count()};
}

std::optional<proto::Refusal> Services::withdraw(NodeIndex provider, GroupIndex group,
                                                 milliseconds now, Effects& effects) {
  Topic* topic = topics_.find_group(group);
  if (topic == nullptr || !topic->provided()) {
    return proto::Refusal{Status::not_found,
                          "no service has the group " + to_string(make_id(topics_.hub(), group))};
  }
  if (topic->service->provider != provider) {
    return proto::Refusal{Status::denied, "the service '" + std::string{topic->full_name} +
                                              "' is provided by another node"};
  }
  Node& node = nodes_[provider];
  node.provides.erase(find_topic(node.provides, *topic));
  topics_.end_provision(*topic, now, effects);
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
  if (Topic* known = topics_.find(full_name)) {
    if (const auto old = find_topic(node.subscribes, *known); old != node.subscribes.end()) {
      old->life = node.life;
      topics_.change_terms(*known, node_index, terms, effects);
      return known;
    }
  }
  if (node.subscribes.size() >= limits_.subscriptions_per_node) {
    forget_if_idle(node_index);
    return limit_reached("subscriptions", limits_.subscriptions_per_node, "subscriptions_per_node");
  }
  Topic& topic = topics_.add_subscriber(full_name, node_index, terms, away, effects);
  node.subscribes.push_back({&topic, node.life});
  return &topic;
}

std::optional<proto::Refusal> Services::unsubscribe(NodeIndex node_index,
                                                    std::string_view full_name, milliseconds now,
                                                    Effects& effects) {
  Topic* known = topics_.find(full_name);
  const auto node = nodes_.find(node_index);
  if (known != nullptr && node != nodes_.end()) {
    auto& list = node->second.subscribes;
    if (const auto declared = find_topic(list, *known); declared != list.end()) {
      list.erase(declared);
      topics_.remove_subscriber(*known, node_index, now, effects);
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

void Services::node_away(NodeIndex node, Effects& effects) {
  const auto found = nodes_.find(node);
  if (found == nodes_.end()) return;
  for (const Declared& declared : found->second.provides)
    topics_.set_provider_away(*declared.topic, true, effects);
}

void Services::node_returned(NodeIndex node, Effects& effects) {
  node_away(node, effects);
  if (const auto found = nodes_.find(node); found != nodes_.end()) ++found->second.life;
}

void Services::drop_undeclared(NodeIndex node_index, milliseconds now, Effects& effects) {
  const auto found = nodes_.find(node_index);
  if (found == nodes_.end()) return;
  Node& node = found->second;
  const std::vector<Declared> unsubscribed = take_undeclared(node.subscribes, node.life);
  const std::vector<Declared> closed = take_undeclared(node.provides, node.life);
  for (const Declared& declared : unsubscribed)
    topics_.remove_subscriber(*declared.topic, node_index, now, effects);
  for (const Declared& declared : closed) topics_.end_provision(*declared.topic, now, effects);
  forget_if_idle(node_index);
}

void Services::node_renamed(NodeIndex node_index, milliseconds now, Effects& effects) {
  const auto found = nodes_.find(node_index);
  if (found == nodes_.end()) return;
  const std::vector<Declared> provides = std::move(found->second.provides);
  found->second.provides.clear();
  for (const Declared& declared : provides) topics_.end_provision(*declared.topic, now, effects);
  forget_if_idle(node_index);
}

void Services::node_renumbered(NodeIndex node_index, NodeIndex new_index, Effects& effects) {
  auto node = nodes_.extract(node_index);
  if (node.empty()) return;
  node.key() = new_index;
  const Node& moved = nodes_.insert(std::move(node)).position->second;
  for (const Declared& declared : moved.provides)
    topics_.renumber_provider(*declared.topic, new_index, effects);
  for (const Declared& declared : moved.subscribes)
    topics_.renumber_subscriber(*declared.topic, node_index, new_index, effects);
}

void Services::node_left(NodeIndex node_index, milliseconds now, Effects& effects) {
  if (const auto found = nodes_.find(node_index); found != nodes_.end()) ++found->second.life;
  drop_undeclared(node_index, now, effects);
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

const ServiceTerms* Services::provided(NodeIndex node, std::string_view full_name) const {
  const Topic* known = topics_.find(full_name);
  if (known == nullptr || !known->provided() || known->service->provider != node) return nullptr;
  return &known->service->terms;
}

std::optional<SubscriberTerms> Services::subscribed(NodeIndex node,
                                                    std::string_view full_name) const {
  const Topic* known = topics_.find(full_name);
  if (known == nullptr || !std::ranges::binary_search(known->subscribers, node))
    return std::nullopt;
  const auto asked = known->terms.find(node);
  return asked != known->terms.end() ? asked->second : SubscriberTerms{};
}

std::size_t Services::services_of(NodeIndex node) const {
  const auto found = nodes_.find(node);
  return found == nodes_.end() ? 0 : found->second.provides.size();
}

void Services::forget_if_idle(NodeIndex node) {
  const auto found = nodes_.find(node);
  if (found == nodes_.end()) return;
  if (found->second.provides.empty() && found->second.subscribes.empty()) nodes_.erase(found);
}

void Services::note_missed(NodeIndex node, const proto::flow::Missed& missed) {
  const Topic* topic = topics_.find_group(missed.group);
  const auto found = nodes_.find(node);
  if (topic == nullptr || found == nodes_.end()) return;
  auto& list = found->second.subscribes;
  if (const auto declared = find_topic(list, *topic); declared != list.end())
    declared->topic->missed[node] = missed.total;
}

std::uint64_t Services::missed_by(NodeIndex node) const {
  const auto found = nodes_.find(node);
  if (found == nodes_.end()) return 0;
  std::uint64_t sum = 0;
  for (const Declared& declared : found->second.subscribes) {
    const auto told = declared.topic->missed.find(node);
    if (told != declared.topic->missed.end()) sum += told->second;
  }
  return sum;
}

}  // namespace gimnet::hub
