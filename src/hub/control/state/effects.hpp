#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "base/ids.hpp"
#include "hub/control/state/place.hpp"
#include "proto/control/link.hpp"
#include "proto/control/ns_watch.hpp"

// The effects that the state machines ask for, to be carried out in their order: whether the table
// or the message comes first is part of the meaning (docs/protocol.md, section 8).

namespace gimnet::hub {

/// Publish the place of this node, or that there is none any more.
struct NodeChanged {
  NodeIndex index;
};
/// Publish who provides this group now, or that there is no such group any more.
struct GroupChanged {
  GroupIndex index;
};
/// A group of another hub: something changed of it, or of what is wanted of it here.
struct AwayGroupChanged {
  GroupId group;
};
/// Publish whether and how that node is a member of this group.
struct MemberChanged {
  GroupId group;
  NodeIndex subscriber;
};
/// Tell the shard that the session is over.
struct SessionEnded {
  Place place;
};
/// Say GOODBYE to the session's connection and close it.
struct CloseDue {
  Place place;
  proto::GoodbyeCode code{};
  std::string sentence;
};
/// Tell the shard that the session's node has another id, by index, and that its connection is to
/// learn it: GOODBYE `renumbered`, after which the node comes back with its token. What waits for
/// it is dropped.
struct RenumberDue {
  Place place;
  NodeIndex former;
  NodeIndex index;
  std::string sentence;
};
/// Tell a service's subscribers what it is now, in pieces. `joins`: its group is new; each of them
/// becomes a member, and is paced, once it was told.
struct ServiceChanged {
  std::string full_name;
  bool joins = false;
};
/// The wishes of a subscriber. 0: none. `number`: of its counts (docs/protocol.md, section 8).
struct SubscriberTerms {
  std::uint32_t window = 0;
  std::uint32_t depth = 1;
  std::uint32_t interval_us = 0;
  std::uint8_t number = 0;
  friend bool operator==(const SubscriberTerms&, const SubscriberTerms&) = default;
};
/// Have the subscriber's shard pace what it gets of a group, as Topic::pace_of() says: after the
/// member was published.
struct PaceDue {
  NodeIndex subscriber;
  GroupId group;
};
/// A subscription that was paced ended.
struct PaceEnded {
  NodeIndex subscriber;
  GroupId group;
};
/// That node provides the retained group no more: its last message is kept no longer. After the
/// table has said so.
struct RetainedDropped {
  NodeIndex provider;
  GroupIndex group;
};
/// Tell a service's provider how many subscribers there are now.
struct SubscribersChanged {
  std::string full_name;
};
/// Keep what Membership::durable() says where it outlives the hub, then call state_kept().
struct StateDue {};

/// Tell a node that a node of another hub has its name, or the full name of its service.
struct NameLossDue {
  NodeIndex node;
  std::string name;
  NodeId holder;
  std::string sentence;
};
/// Those who watch are to hear of a node. Its record is looked up; the name is that of a node which
/// has left.
struct NodeNoted {
  proto::ns::ChangeKind kind{};
  NodeIndex index;
  std::string name;
  std::string former_name;
};
/// Those who watch are to hear of a service.
struct ServiceNoted {
  proto::ns::ChangeKind kind{};
  GroupIndex group;
  NodeIndex provider;
  std::string full_name;
};

/// A service that accepts has lost its provider's connection, or is there again: other hubs are to
/// know. Those who watch are not told.
struct AcceptanceChanged {
  GroupIndex group;
};

using Effect =
    std::variant<NodeChanged, GroupChanged, AwayGroupChanged, MemberChanged, SessionEnded,
                 ServiceChanged, PaceDue, PaceEnded, RetainedDropped, SubscribersChanged, CloseDue,
                 RenumberDue, StateDue, NameLossDue, NodeNoted, ServiceNoted, AcceptanceChanged>;
using Effects = std::vector<Effect>;

}  // namespace gimnet::hub
