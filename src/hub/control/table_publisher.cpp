#include "hub/control/table_publisher.hpp"

#include "base/check.hpp"

namespace gimnet::hub {

TablePublisher::TablePublisher(HubId hub, std::size_t shards, const Tables& tables)
    : hub_(hub), shards_(shards), tables_(tables) {}

TablePublisher::~TablePublisher() {
  for (const auto& [index, members] : published_) static_cast<void>(tables_.groups.exchange(index, nullptr));
}

void TablePublisher::publish_node(std::uint32_t index, const Membership& membership) {
  const Session* session = membership.sessions().find(index);
  NodePlace place;
  if (session != nullptr) {
    place = NodePlace{session->place.shard, session->place.slot, session->place.generation};
  } else if (membership.sessions().present_index(index) != index) {
    place = NodePlace::renumbered();
  }
  tables_.nodes.publish(index, place);
}

void TablePublisher::publish_group(std::uint32_t index, const Membership& membership) {
  std::unique_ptr<GroupMembers> members;
  if (const Topic* topic = membership.services().find_group(index); topic != nullptr) {
    members = std::make_unique<GroupMembers>();
    const Session* provider = membership.sessions().find(topic->service->provider);
    GIMNET_CHECK(provider != nullptr);
    members->provider = make_id<NodeId>(hub_, topic->service->provider);
    members->provider_shard = provider->place.shard;
    members->by_shard.resize(shards_);
    members->retain = topic->service->terms.retain;
    for (const std::uint32_t subscriber : topic->subscribers) {
      const Session* session = membership.sessions().find(subscriber);
      GIMNET_CHECK(session != nullptr);
      const Place& place = session->place;
      if (!topic->pace_of(subscriber)) {
        members->by_shard[place.shard.value()].push_back({place.slot, place.generation});
        continue;
      }
      members->paced_by_shard.resize(shards_);
      const bool was_plain = topic->once_plain.contains(subscriber);
      members->paced_by_shard[place.shard.value()].push_back({place.slot, place.generation, was_plain});
    }
  }
  static_cast<void>(tables_.groups.exchange(index, members.get()));
  std::unique_ptr<const GroupMembers>& current = published_[index];
  if (current != nullptr) garbage_.push_back({tables_.quiescence.ticket(), std::move(current)});
  if (members == nullptr) {
    published_.erase(index);
  } else {
    current = std::move(members);
  }
  collect();
}

bool TablePublisher::collect() {
#ifdef GIMNET_BUG_LAST_LIST_IS_KEPT
  while (garbage_.size() > 1 && tables_.quiescence.passed(garbage_.front().ticket)) garbage_.pop_front();
#else
  while (!garbage_.empty() && tables_.quiescence.passed(garbage_.front().ticket)) garbage_.pop_front();
#endif
  return !garbage_.empty();
}

}  // namespace gimnet::hub
