#pragma once

#include <cstdint>

#include "base/ids.hpp"
#include "hub/data/tables/group_table.hpp"
#include "hub/data/tables/node_table.hpp"

namespace gimnet::hub {

/// Counts the recipients that a frame for another shard has there. If that shard never gets the
/// frame, it counts as so many dropped frames. Thread safety: one shard; the tables are published
/// by the conductor.
class ShardRecipients {
 public:
  ShardRecipients(const NodeTable& nodes, const GroupTable& groups)
      : nodes_(nodes), groups_(groups) {}

  /// REQUIRES: a whole frame that the router handed over to that shard.
  [[nodiscard]] std::uint32_t count(ShardIndex shard, const std::byte* frame) const;

 private:
  [[nodiscard]] std::uint32_t count_members(ShardIndex shard, GroupId group) const;

  const NodeTable& nodes_;
  const GroupTable& groups_;
};

}  // namespace gimnet::hub
