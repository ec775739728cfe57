#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "base/ids.hpp"
#include "hub/control/state/place.hpp"
#include "proto/control/link.hpp"
#include "proto/control/ns_watch.hpp"

// What the state machines want done, to be carried out in this order: tables first or messages
// first is part of the meaning (docs/protocol.md, section 8).

namespace gimnet::hub {

/// Publish the place of this node, or that there is none any more.
struct NodeChanged {
  std::uint32_t index = 0;
};
/// Publish the members of this group, or that there is none any more.
struct GroupChanged {
  std::uint32_t index = 0;
};
/// Publish whether and how that node is a member of this group.
struct MemberChanged {
  std::uint32_t group = 0;
  std::uint32_t subscriber = 0;
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
/// learn it: GOODBYE `renumbered`, after which the node comes back with its token.
struct RenumberDue {
  Place place;
  std::uint32_t former = 0;
  std::uint32_t index = 0;
  std::string sentence;
};
/// Tell subscribers that a service has another group id: all those that have the same window.
/// Groups and nodes are named by index here; 0: none.
struct ServiceMovedDue {
  std::vector<std::uint32_t> subscribers;
  std::string full_name;
  std::uint32_t old_group = 0;
  std::uint32_t new_group = 0;
  std::uint32_t message_type = 0;
  std::uint32_t instance = 0;
  proto::ns::Delivery delivery = proto::ns::Delivery::stream;
  std::uint32_t window = 0;
  bool retain = false;
  proto::ns::Direction direction = proto::ns::Direction::provides;
  std::uint64_t move = 0;  ///< numbers the moves of a hub's services: that one and those before it
  // Told once more, to a node that came back
  bool again = false;
  std::vector<std::uint32_t> between;  ///< groups that the service had since `old_group`, in order
};
/// What a subscriber asked for. 0: not.
struct SubscriberTerms {
  std::uint32_t window = 0;
  std::uint32_t depth = 1;
  std::uint32_t interval_us = 0;
  friend bool operator==(const SubscriberTerms&, const SubscriberTerms&) = default;
};
/// Have the subscriber's shard pace what it gets of a group: after the group was published. `terms`
/// are in force.
struct PaceDue {
  std::uint32_t subscriber = 0;
  std::uint32_t group = 0;
  SubscriberTerms terms;
  bool retained = false;   ///< it begins with the last message
  bool was_plain = false;  ///< it got everything before, in this group
};
/// A subscription that was paced ended; `group_gone`: so did the group.
struct PaceEnded {
  std::uint32_t subscriber = 0;
  std::uint32_t group = 0;
  bool group_gone = false;
};
/// A retained group is gone: its last message is kept no longer.
struct RetainedDropped {
  std::uint32_t provider = 0;
  std::uint32_t group = 0;
};
/// Tell a provider that somebody came or went.
struct SubscriberDue {
  std::uint32_t provider = 0;
  std::uint32_t group = 0;
  std::uint32_t subscriber = 0;
  std::uint32_t subscribers_now = 0;
  bool joined = false;
};
/// Keep what Membership::durable() says where it outlives the hub, then call state_kept().
struct StateDue {};

/// Tell a node what became of its claim to a name.
struct NameDecided {
  std::uint32_t node = 0;
  std::string name;
  bool confirmed = false;
  NodeId holder{};  ///< who has it, if it is not confirmed
  std::string sentence;
};
/// Those who watch are to hear of a node. Its record is looked up; the name is that of a node which
/// has left.
struct NodeNoted {
  proto::ns::ChangeKind kind{};
  std::uint32_t index = 0;
  std::string name;
  std::string former_name;
};
/// Those who watch are to hear of a service.
struct ServiceNoted {
  proto::ns::ChangeKind kind{};
  std::uint32_t group = 0;
  std::uint32_t provider = 0;
  std::string full_name;
};

using Effect = std::variant<NodeChanged, GroupChanged, MemberChanged, SessionEnded, ServiceMovedDue,
                            PaceDue, PaceEnded, RetainedDropped, SubscriberDue, CloseDue,
                            RenumberDue, StateDue, NameDecided, NodeNoted, ServiceNoted>;
using Effects = std::vector<Effect>;

}  // namespace gimnet::hub
