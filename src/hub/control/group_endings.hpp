#pragma once

#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <utility>
#include <vector>

#include "hub/control/shard_proxy.hpp"

namespace gimnet::hub {

/// Groups that ended, until the last frames that their providers sent have reached every shard.
///
/// A provider's shard hands the frames of a group over to others by their mailboxes, and tells the
/// conductor by its inbox that the group is to end (WITHDRAW, another name, GOODBYE). The two may
/// overtake each other: a shard that is late would find no group for frames that the subscribers on
/// other shards got. So a group ends in two steps. First the table says that it has no provider:
/// from then on its provider's shard takes nothing in for it. Then that shard posts a fence behind
/// all that it handed over. When every other shard has taken the fence from its mailbox, which
/// keeps the order, it has taken the group's last frame, and the group is cleared. A pace of it
/// ends then, not before.
///
/// One fence of a shard is under way at a time, for all groups that ended before it was asked for;
/// those that end meanwhile share the next one. So a provider that comes and goes fills no mailbox.
/// Thread safety: the conductor's thread only.
class GroupEndings {
 public:
  explicit GroupEndings(ShardProxy& shards) : shards_(shards), fences_(shards.shards()) {}

  /// The table says that this group has no provider any more. REQUIRES: !contains(group), two
  /// shards at least.
  void begin(GroupIndex group, ShardIndex provider_shard);
  [[nodiscard]] bool contains(GroupIndex group) const { return endings_.contains(group); }
  /// To be sent once the group is cleared. REQUIRES: contains(group).
  void defer(GroupIndex group, ShardIndex shard, const EndPaceCommand& command);
  /// Returns the groups that are to be cleared now, each followed by finish().
  [[nodiscard]] std::vector<GroupIndex> on_passed(const FencePassedEvent& event);
  /// The group was cleared, or is about to be another one's: sends what was deferred. Nothing if it
  /// does not end.
  void finish(GroupIndex group);

 private:
  struct Ending {
    std::uint32_t ticket = 0;  ///< of the fence that it waits for
    std::vector<std::pair<ShardIndex, EndPaceCommand>> deferred;
  };
  /// The fence of one shard.
  struct UnderWay {
    std::uint32_t ticket = 0;
    std::size_t awaited = 0;         ///< shards that have not answered; 0: none is under way
    std::vector<GroupIndex> groups;  ///< that wait for it
    std::vector<GroupIndex> next;    ///< that wait for the one behind it
  };
  void post(ShardIndex shard, UnderWay& fence);

  ShardProxy& shards_;
  std::vector<UnderWay> fences_;  ///< by shard
  std::unordered_map<GroupIndex, Ending> endings_;
};

}  // namespace gimnet::hub
