#include "hub/data/fanout/shard_recipients.hpp"

#include "proto/frame/frame_header.hpp"

namespace gimnet::hub {

std::uint32_t ShardRecipients::count(ShardIndex shard, const std::byte* frame) const {
  const proto::FrameHeader header = proto::load_header(frame);
  switch (header.kind) {
    case proto::Kind::group:
      return count_members(shard, GroupId{header.dst});
    case proto::Kind::list:
      return header.dst;  // each shard gets the ids of its own nodes
    case proto::Kind::broadcast:
      return nodes_.nodes_on(shard);  // its sender lives where it was taken in
    default:
      return 1;
  }
}

std::uint32_t ShardRecipients::count_members(ShardIndex shard, GroupId group) const {
  const GroupMembers* members = groups_.find(group);
  if (members == nullptr) return 0;
  std::size_t there = members->by_shard[shard.value()].size();
  if (!members->paced_by_shard.empty()) there += members->paced_by_shard[shard.value()].size();
  return static_cast<std::uint32_t>(there);
}

}  // namespace gimnet::hub
