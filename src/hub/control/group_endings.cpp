#include "hub/control/group_endings.hpp"

#include "base/check.hpp"

namespace gimnet::hub {

void GroupEndings::begin(GroupIndex group, ShardIndex provider_shard) {
  GIMNET_CHECK(fences_.size() > 1 && !contains(group));
  UnderWay& fence = fences_[provider_shard.value()];
  endings_[group].ticket = fence.ticket + 1;
  fence.next.push_back(group);
  if (fence.awaited == 0) post(provider_shard, fence);
}

void GroupEndings::post(ShardIndex shard, UnderWay& fence) {
  fence.groups = std::exchange(fence.next, {});
  fence.awaited = fences_.size() - 1;
  shards_.send(shard, FenceCommand{++fence.ticket});
}

void GroupEndings::defer(GroupIndex group, ShardIndex shard, const EndPaceCommand& command) {
  endings_.at(group).deferred.emplace_back(shard, command);
}

std::vector<GroupIndex> GroupEndings::on_passed(const FencePassedEvent& event) {
  UnderWay& fence = fences_[event.fence.of.value()];
  GIMNET_CHECK(event.fence.ticket == fence.ticket && fence.awaited != 0);
  if (--fence.awaited != 0) return {};
  // One that began anew meanwhile, and perhaps ended again, does not wait for this fence.
  std::erase_if(fence.groups, [&](GroupIndex group) {
    const auto found = endings_.find(group);
    return found == endings_.end() || found->second.ticket != event.fence.ticket;
  });
  std::vector<GroupIndex> over = std::exchange(fence.groups, {});
  if (!fence.next.empty()) post(event.fence.of, fence);
  return over;
}

void GroupEndings::finish(GroupIndex group) {
  const auto ending = endings_.extract(group);
  if (!ending) return;
  for (const auto& [shard, command] : ending.mapped().deferred) shards_.send(shard, command);
}

}  // namespace gimnet::hub
