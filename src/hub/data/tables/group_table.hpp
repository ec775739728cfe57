#pragma once

#include <atomic>
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
  /// Where its provider's session lives: frames to the service go there.
  NodePlace provider_place;
  /// One entry per shard of the hub, each with the members that live there.
  std::vector<MemberList<GroupMember>> by_shard;
  /// Those of which the shard paces what they get; empty if there are none.
  std::vector<MemberList<PacedMember>> paced_by_shard;
  bool retain = false;  ///< the provider's shard keeps the last message; then all members are paced
  bool accepts = false;  ///< the service takes data: frames of kind SERVICE go to its provider

  [[nodiscard]] bool provided() const { return provider != NodeId{}; }
};

/// Group index to recipients, for the groups that this hub owns. Thread safety: one writer (the
/// conductor), any number of readers; reads are wait-free. A reader's pointer is good until its
/// shard's turn ends.
class GroupTable {
 public:
  GroupTable();
  ~GroupTable();
  GroupTable(const GroupTable&) = delete;
  GroupTable& operator=(const GroupTable&) = delete;

  /// Puts `members` (or nullptr: no such group) in place and returns what stood there, which the
  /// caller frees after a grace period. REQUIRES: index < 2^20.
  [[nodiscard]] const GroupMembers* exchange(std::uint32_t index, const GroupMembers* members);

  /// REQUIRES: index < 2^20. nullptr when no group has that index.
  [[nodiscard]] const GroupMembers* find(std::uint32_t index) const {
    return members_[index].load(
        std::memory_order_acquire);  // pairs with the exchange in exchange()
  }

 private:
  std::atomic<const GroupMembers*>* members_;
};

}  // namespace gimnet::hub
