#include "hub/control/table_publisher.hpp"

#include <algorithm>

#include "base/check.hpp"
#include "proto/control/ns.hpp"

namespace gimnet::hub {
namespace {
NodePlace node_place(const Session& session) {
  return {session.place.shard, session.place.slot, session.place.generation};
}

void drop_empty(GroupMembers& members) {
  const auto is_empty = [](const auto& list) { return list.empty(); };
  if (std::ranges::all_of(members.paced_by_shard, is_empty)) members.paced_by_shard.clear();
}

}  // namespace

TablePublisher::TablePublisher(HubId hub, std::size_t shards, const Tables& tables)
    : hub_(hub), shards_(shards), tables_(tables) {}

TablePublisher::~TablePublisher() {
  for (const auto& [group, members] : published_) {
    const bool own = hub_of(group) == hub_;
    static_cast<void>(own ? tables_.groups.exchange(index_of(group), nullptr)
                          : tables_.groups.exchange_away(group, nullptr));
  }
}

void TablePublisher::expect_all(const IndexSet& used) {
  const std::size_t end = 8 * used.bytes().size();
  for (std::uint32_t index = 1; index < end; ++index) {
    if (used.contains(index)) tables_.nodes.expect(index);
  }
}

void TablePublisher::publish_node(NodeIndex index, const Membership& membership) {
  const Session* session = membership.sessions().find(index);
  NodePlace place;
  if (session != nullptr) {
    place = node_place(*session);
  } else if (membership.sessions().present_index(index) != index) {
    place = NodePlace::renumbered();
  }
  tables_.nodes.publish(index.value(), place);
}

void TablePublisher::publish_group(GroupIndex index, const Membership& membership) {
  const GroupId group = make_id(hub_, index);
  const Topic* topic = membership.topics().find_group(index);
  if (topic == nullptr) return replace(group, nullptr);
  auto members = copy_of(group);
  const Session* provider = membership.sessions().find(topic->service->provider);
  members->provider = provider == nullptr ? NodeId{} : make_id(hub_, provider->index);
  members->provider_place = provider == nullptr ? NodePlace{} : node_place(*provider);
  members->retain = topic->service->terms.retain;
  members->accepts = topic->service->terms.direction == proto::ns::Direction::accepts;
  replace(group, std::move(members));
}

std::unique_ptr<GroupMembers> TablePublisher::copy_of(GroupId group) const {
  const auto found = published_.find(group);
  auto members = found != published_.end() ? std::make_unique<GroupMembers>(*found->second)
                                           : std::make_unique<GroupMembers>();
  members->by_shard.resize(shards_);
  return members;
}

void TablePublisher::publish_away(GroupId group, const std::optional<AwayGroup>& away,
                                  const Membership& membership) {
  GIMNET_CHECK(hub_of(group) != hub_);
  if (!away) {
    if (is_published(group)) replace(group, nullptr);
    return;
  }
  auto members = copy_of(group);
  if (membership.topics().find_group(group) == nullptr) {
    for (auto& list : members->by_shard) list = {};
    members->paced_by_shard.clear();
  }
  members->provider = away->provider;
  members->provider_place = away->link;
  members->parent = away->parent;
  members->retain = away->retain;
  replace(group, std::move(members));
}

void TablePublisher::publish_members(GroupId group, std::span<const NodeIndex> subscribers,
                                     const Membership& membership) {
  const Topic* topic = membership.topics().find_group(group);
  if (!is_published(group) || (topic == nullptr && hub_of(group) == hub_)) return;
  auto members = copy_of(group);
  for (const NodeIndex subscriber : subscribers) put(*members, topic, subscriber, membership);
  drop_empty(*members);
  replace(group, std::move(members));
}

void TablePublisher::publish_links(GroupId group, std::span<const LinkMember> links,
                                   std::span<const NodePlace> gone) {
  if (!is_published(group) || (links.empty() && gone.empty())) return;
  auto members = copy_of(group);
  for (const NodePlace& place : gone) {
    members->by_shard[place.shard.value()].erase(place.slot);
    if (!members->paced_by_shard.empty())
      members->paced_by_shard[place.shard.value()].erase(place.slot);
  }
  for (const LinkMember& link : links) put(*members, link);
  drop_empty(*members);
  replace(group, std::move(members));
}

void TablePublisher::put(GroupMembers& members, const LinkMember& link) const {
  const NodePlace& place = link.place;
  const std::size_t shard = place.shard.value();
  auto& paced = members.paced_by_shard;
  if (!link.paced) {
    if (!paced.empty()) paced[shard].erase(place.slot);
    return members.by_shard[shard].put({place.slot, place.generation});
  }
  members.by_shard[shard].erase(place.slot);
  paced.resize(shards_);
  paced[shard].put({place.slot, place.generation, link.was_plain});
}

NodePlace TablePublisher::place_of(NodeIndex node, const Membership& membership) const {
  const Session* session = membership.sessions().find(node);
  if (session == nullptr) return tables_.nodes.find(node.value());
  return node_place(*session);
}

/// In one of the two lists, or in none if it is no subscriber any more.
void TablePublisher::put(GroupMembers& members, const Topic* topic, NodeIndex subscriber,
                         const Membership& membership) const {
  const NodePlace place = place_of(subscriber, membership);
  GIMNET_CHECK(place.exists());
  const std::size_t shard = place.shard.value();
  auto& plain = members.by_shard[shard];
  auto& paced = members.paced_by_shard;
  const bool subscribed =
      topic != nullptr && std::ranges::binary_search(topic->subscribers, subscriber);
  const bool has_pace = subscribed && topic->pace_of(subscriber);
  if (!subscribed || has_pace) plain.erase(place.slot);
  if (!has_pace && !paced.empty()) paced[shard].erase(place.slot);
  if (!subscribed) return;
  if (!has_pace) return plain.put({place.slot, place.generation});
  paced.resize(shards_);
  const bool was_plain = topic->once_plain.contains(subscriber);
  paced[shard].put({place.slot, place.generation, was_plain});
}

void TablePublisher::replace(GroupId group, std::unique_ptr<const GroupMembers> members) {
  static_cast<void>(hub_of(group) == hub_ ? tables_.groups.exchange(index_of(group), members.get())
                                          : tables_.groups.exchange_away(group, members.get()));
  std::unique_ptr<const GroupMembers>& current = published_[group];
  if (current != nullptr) garbage_.push_back({tables_.quiescence.ticket(), std::move(current)});
  if (members == nullptr) {
    published_.erase(group);
  } else {
    current = std::move(members);
  }
  collect();
}

void TablePublisher::collect() {
  while (!garbage_.empty() && tables_.quiescence.passed(garbage_.front().ticket))
    garbage_.pop_front();
}

}  // namespace gimnet::hub
