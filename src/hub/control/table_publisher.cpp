#include "hub/control/table_publisher.hpp"

#include <algorithm>

#include "base/check.hpp"
#include "proto/control/ns.hpp"

namespace gimnet::hub {
namespace {
NodePlace node_place(const Session& session) {
  return {session.place.shard, session.place.slot, session.place.generation};
}
}  // namespace

TablePublisher::TablePublisher(HubId hub, std::size_t shards, const Tables& tables)
    : hub_(hub), shards_(shards), tables_(tables) {}

TablePublisher::~TablePublisher() {
  for (const auto& [index, members] : published_)
    static_cast<void>(tables_.groups.exchange(index.value(), nullptr));
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
  std::unique_ptr<GroupMembers> members;
  if (const Topic* topic = membership.services().find_group(index); topic != nullptr) {
    members = std::make_unique<GroupMembers>();
    const Session* provider = membership.sessions().find(topic->service->provider);
    GIMNET_CHECK(provider != nullptr);
    members->provider = make_id(hub_, topic->service->provider);
    members->provider_place = node_place(*provider);
    members->by_shard.resize(shards_);
    members->retain = topic->service->terms.retain;
    members->accepts = topic->service->terms.direction == proto::ns::Direction::accepts;
    for (const NodeIndex subscriber : topic->subscribers) {
      const NodePlace place = place_of(subscriber, membership);
      GIMNET_CHECK(place.exists());
      put(*members, *topic, subscriber, place);
    }
  }
  replace(index, std::move(members));
}

bool TablePublisher::publish_member(GroupIndex index, NodeIndex subscriber,
                                    const Membership& membership) {
  const auto found = published_.find(index);
  const Topic* topic = membership.services().find_group(index);
  const NodePlace place = place_of(subscriber, membership);
  if (found == published_.end() || found->second->ends() || topic == nullptr || !place.exists())
    return false;
  auto members = std::make_unique<GroupMembers>(*found->second);
  members->by_shard[place.shard.value()].erase(place.slot);
  auto& paced = members->paced_by_shard;
  if (!paced.empty() && paced[place.shard.value()].erase(place.slot)) {
    if (std::ranges::all_of(paced, [](const auto& list) { return list.empty(); })) paced.clear();
  }
  if (std::ranges::binary_search(topic->subscribers, subscriber))
    put(*members, *topic, subscriber, place);
  replace(index, std::move(members));
  return true;
}

NodePlace TablePublisher::place_of(NodeIndex node, const Membership& membership) const {
  const Session* session = membership.sessions().find(node);
  if (session == nullptr) return tables_.nodes.find(node.value());
  return node_place(*session);
}

void TablePublisher::put(GroupMembers& members, const Topic& topic, NodeIndex subscriber,
                         const NodePlace& place) const {
  if (!topic.pace_of(subscriber)) {
    members.by_shard[place.shard.value()].put({place.slot, place.generation});
    return;
  }
  members.paced_by_shard.resize(shards_);
  const bool was_plain = topic.once_plain.contains(subscriber);
  members.paced_by_shard[place.shard.value()].put({place.slot, place.generation, was_plain});
}

std::optional<ShardIndex> TablePublisher::end_group(GroupIndex index) {
  const auto found = published_.find(index);
  if (found == published_.end()) return std::nullopt;
  const GroupMembers& before = *found->second;
  const ShardIndex provider_shard = before.provider_place.shard;
  const auto is_elsewhere = [provider_shard](const auto& by_shard) {
    for (std::size_t shard = 0; shard < by_shard.size(); ++shard) {
      if (shard != provider_shard.value() && !by_shard[shard].empty()) return true;
    }
    return false;
  };
  if (!is_elsewhere(before.by_shard) && !is_elsewhere(before.paced_by_shard)) {
    replace(index, nullptr);
    return std::nullopt;
  }
  auto ending = std::make_unique<GroupMembers>(before);
  ending->provider = NodeId{};
  replace(index, std::move(ending));
  return provider_shard;
}

void TablePublisher::clear_group(GroupIndex index) { replace(index, nullptr); }

void TablePublisher::replace(GroupIndex index, std::unique_ptr<const GroupMembers> members) {
  static_cast<void>(tables_.groups.exchange(index.value(), members.get()));
  std::unique_ptr<const GroupMembers>& current = published_[index];
  if (current != nullptr) garbage_.push_back({tables_.quiescence.ticket(), std::move(current)});
  if (members == nullptr) {
    published_.erase(index);
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
