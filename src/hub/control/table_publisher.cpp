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
    put_provider(*members, topic->service->provider, membership);
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

void TablePublisher::publish_provider(GroupIndex index, const Membership& membership) {
  const auto found = published_.find(index);
  const Topic* topic = membership.services().find_group(index);
  if (found == published_.end() || topic == nullptr) return publish_group(index, membership);
  auto members = std::make_unique<GroupMembers>(*found->second);
  put_provider(*members, topic->service->provider, membership);
  replace(index, std::move(members));
}

void TablePublisher::put_provider(GroupMembers& members, NodeIndex provider,
                                  const Membership& membership) const {
  const Session* session = membership.sessions().find(provider);
  members.provider = session == nullptr ? NodeId{} : make_id(hub_, provider);
  members.provider_place = session == nullptr ? NodePlace{} : node_place(*session);
}

bool TablePublisher::publish_member(GroupIndex index, NodeIndex subscriber,
                                    const Membership& membership) {
  const auto found = published_.find(index);
  const Topic* topic = membership.services().find_group(index);
  const NodePlace place = place_of(subscriber, membership);
  if (found == published_.end() || topic == nullptr || !place.exists()) return false;
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
