#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <unordered_map>

#include "hub/concurrent/quiescence.hpp"
#include "hub/control/state/membership.hpp"
#include "hub/data/tables/group_table.hpp"
#include "hub/data/tables/node_table.hpp"

namespace gimnet::hub {

/// Writes the tables that shards read. Lists of members that were replaced are freed when no shard
/// can still look at them. Thread safety: the conductor's thread only. Ownership: of all published
/// lists; shards must have ended, or left their turns for good, before it is destroyed.
class TablePublisher {
 public:
  struct Tables {
    NodeTable& nodes;
    GroupTable& groups;
    Quiescence& quiescence;
  };
  TablePublisher(HubId hub, std::size_t shards, const Tables& tables);
  ~TablePublisher();
  TablePublisher(const TablePublisher&) = delete;
  TablePublisher& operator=(const TablePublisher&) = delete;

  /// Nodes whose ids were handed out before a restart, or may have been, wherever REASSIGN put
  /// them.
  void expect_all(const IndexSet& used);
  /// Publishes what `membership` says of the node now.
  void publish_node(NodeIndex index, const Membership& membership);
  /// Publishes who provides the group now, or that there is no such group any more. A new group has
  /// no members yet; those of a known one are shared with the entry that stood there.
  void publish_group(GroupIndex index, const Membership& membership);
  /// A group of another hub, as far as shards have to know it.
  struct AwayGroup {
    NodeId provider;  ///< 0: nobody at the moment
    HubId parent;     ///< the neighbour that its messages come from
    NodePlace link;   ///< to it
    bool retain = false;
  };
  /// The same of a group of another hub. Its members are kept while somebody here has subscribed,
  /// or else to be published anew. Nothing: nobody wants it any more.
  void publish_away(GroupId group, const std::optional<AwayGroup>& away,
                    const Membership& membership);
  /// A link with subscribers behind it.
  struct LinkMember {
    NodePlace place;
    bool paced = false;
    bool was_plain = false;  ///< as in PacedMember
  };
  /// Publishes all links of a group, and that others are members no more. Nothing, if the group is
  /// not published.
  void publish_links(GroupId group, std::span<const LinkMember> links,
                     std::span<const NodePlace> gone);
  [[nodiscard]] bool is_published(GroupId group) const { return published_.contains(group); }

  /// Publishes what `membership` says of those subscribers of the group, and of nothing else:
  /// little work, whatever the group's size. Nothing, if the group is not published or is to go.
  /// REQUIRES: a node whose session is over lives where the table of nodes says.
  void publish_members(GroupId group, std::span<const NodeIndex> subscribers,
                       const Membership& membership);
  void publish_members(GroupIndex index, std::span<const NodeIndex> subscribers,
                       const Membership& membership) {
    publish_members(make_id(hub_, index), subscribers, membership);
  }

  /// Frees what nobody looks at any more.
  void collect();
  [[nodiscard]] std::size_t garbage() const { return garbage_.size(); }

 private:
  struct Garbage {
    std::uint64_t ticket;
    std::unique_ptr<const GroupMembers> members;
  };
  /// The place where the node lives, or lived until now.
  [[nodiscard]] NodePlace place_of(NodeIndex node, const Membership& membership) const;
  void put(GroupMembers& members, const Topic* topic, NodeIndex subscriber,
           const Membership& membership) const;
  void put(GroupMembers& members, const LinkMember& link) const;
  /// The list that stands there now, or an empty one.
  [[nodiscard]] std::unique_ptr<GroupMembers> copy_of(GroupId group) const;
  void replace(GroupId group, std::unique_ptr<const GroupMembers> members);

  const HubId hub_;
  const std::size_t shards_;
  const Tables tables_;
  std::unordered_map<GroupId, std::unique_ptr<const GroupMembers>> published_;
  std::deque<Garbage> garbage_;  ///< Limit: what was replaced within one turn of the slowest shard
};

}  // namespace gimnet::hub
