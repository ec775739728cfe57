#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/ids.hpp"
#include "hub/data/tables/member_list.hpp"
#include "hub/data/tables/node_table.hpp"

namespace gimnet::hub {

/// A recipient of a group on one shard.
struct GroupMember {
  ConnectionSlot slot;
  std::uint32_t generation = 0;
};

/// A recipient of a group whose shard paces what it gets (Pacer).
struct PacedMember {
  ConnectionSlot slot;
  std::uint32_t generation = 0;
  /// It got everything before it was paced, and does until its shard has heard of the pace. One
  /// that has only just subscribed gets nothing until then.
  bool was_plain = false;
};

/// The recipients of one group at one moment. A copy shares the lists, so that one member more or
/// less is cheap in a group of any size. Thread safety: immutable once published. Ownership: the
/// table publisher, which frees it when no shard can still look at it (concurrent/quiescence.hpp).
struct GroupMembers {
  NodeId provider;  ///< 0: nobody at the moment
  /// The place of its provider's session, or the link to the parent: frames to the service go to
  /// it.
  NodePlace provider_place;
  /// One entry per shard of the hub, each with the members that live there.
  std::vector<MemberList<GroupMember>> by_shard;
  /// Those of which the shard paces what they get; empty if there are none.
  std::vector<MemberList<PacedMember>> paced_by_shard;
  /// Of a group of another hub: the neighbour that its messages come from. 0: this hub's own.
  HubId parent;
  bool retain = false;  ///< the provider's shard keeps the last message; then all members are paced
  bool accepts = false;  ///< the service takes data: frames of kind SERVICE go to its provider

  [[nodiscard]] bool provided() const { return provider != NodeId{}; }
};

/// Groups to recipients: those that this hub has, by index, and those of other hubs that somebody
/// here or behind a link wants. Thread safety: one writer (the conductor), any number of readers;
/// reads are wait-free. A reader's pointer is good until its shard's turn ends.
class GroupTable {
 public:
  GroupTable();
  ~GroupTable();
  GroupTable(const GroupTable&) = delete;
  GroupTable& operator=(const GroupTable&) = delete;

  /// Puts `members` (or nullptr: no such group) in place and returns what stood there, which the
  /// caller frees after a grace period. REQUIRES: index < 2^20.
  [[nodiscard]] const GroupMembers* exchange(std::uint32_t index, const GroupMembers* members);

  /// The same for a group of another hub. REQUIRES: hub < 4096, index < 2^20.
  [[nodiscard]] const GroupMembers* exchange_away(GroupId group, const GroupMembers* members);
  /// nullptr: nobody here wants it.
  [[nodiscard]] const GroupMembers* find_away(GroupId group) const {
    // acquire pairs with the release store in exchange_away()
    const Entry* entries = away_[hub_of(group).value()].load(std::memory_order_acquire);
    return entries == nullptr ? nullptr : entries[index_of(group)].load(std::memory_order_acquire);
  }
  /// A group of which a frame or a subscription came this far: of a hub that never had any here it
  /// is this hub's own.
  [[nodiscard]] const GroupMembers* find(GroupId group) const {
    const Entry* entries = away_[hub_of(group).value()].load(std::memory_order_acquire);
    return (entries == nullptr ? members_ : entries)[index_of(group)].load(
        std::memory_order_acquire);  // as in find_away(), and below
  }

  /// REQUIRES: index < 2^20. nullptr when no group has that index.
  [[nodiscard]] const GroupMembers* find(std::uint32_t index) const {
    return members_[index].load(
        std::memory_order_acquire);  // pairs with the exchange in exchange()
  }

 private:
  using Entry = std::atomic<const GroupMembers*>;
  static constexpr std::size_t kHubIds = 4096;

  Entry* members_;
  std::array<std::atomic<Entry*>, kHubIds> away_{};  ///< by hub id; nullptr: none yet
};

}  // namespace gimnet::hub
