#pragma once

#include <chrono>

#include "base/ids.hpp"
#include "hub/control/group_links.hpp"
#include "hub/control/hub_facts.hpp"
#include "hub/control/network_names.hpp"
#include "hub/control/shard_proxy.hpp"
#include "hub/control/state/effects.hpp"
#include "hub/control/state/membership.hpp"
#include "hub/control/state/watches.hpp"
#include "hub/control/state_keeper.hpp"
#include "hub/control/table_publisher.hpp"
#include "hub/control/tellings.hpp"
#include "hub/limits.hpp"
#include "proto/control/control_message.hpp"

namespace gimnet::hub {

// The changes of nodes and services as lines of level debug: what somebody who watches everything
// is told, and who has another id. Costs nothing at other levels. Thread safety: the conductor's
// thread only.

/// REQUIRES: `membership` is as it was left by what led to the change.
void log_change(const NodeNoted& noted, const Membership& membership, HubId hub);
void log_change(const ServiceNoted& noted, const Membership& membership, HubId hub);
void log_change(const RenumberDue& due, const Membership& membership, HubId hub);

/// Carries out what the state machines want done: publishes tables, commands shards, tells nodes,
/// and keeps what has to outlive the hub. In the order in which they wanted it, which is part of
/// its meaning (state/effects.hpp). Thread safety: the conductor's thread only. Lifetime: all its
/// parts outlive it.
class EffectRunner {
 public:
  struct Parts {
    const HubFacts& facts;
    const Limits& limits;
    ShardProxy& shards;
    Membership& membership;
    Watches& watches;
    TablePublisher& publisher;
    StateKeeper& keeper;
    NetworkNames* names = nullptr;  ///< or none: a hub alone
    GroupLinks* groups = nullptr;   ///< or none: a hub alone
  };
  explicit EffectRunner(const Parts& parts)
      : parts_(parts),
        tellings_({parts.facts, parts.shards, parts.membership, parts.watches, parts.publisher,
                   parts.names}) {}

  /// Tells limits.told_at_once subscribers at most; the others wait for tell_rest().
  void carry_out(const Effects& effects, std::chrono::milliseconds now);
  /// The next piece of what nodes have yet to be told of services. True: there is more.
  [[nodiscard]] bool tell_rest();
  /// Events for that connection were dropped, and its control queue is empty: tell the node again.
  void events_missed(const Session& session, std::uint32_t attachment);
  /// Sends an event of kind NS, which is dropped if the node does not take what it is told; nothing
  /// to a node that is away.
  void send_event(const Session& session, const proto::Payload& payload);
  [[nodiscard]] const Tellings& tellings() const { return tellings_; }

 private:
  void run(const NodeChanged& effect);
  void run(const GroupChanged& effect);
  void run(const AwayGroupChanged& effect);
  void run(const AcceptanceChanged& effect);
  void run(const MemberChanged& effect);
  void run(const SessionEnded& effect);
  void run(const RenumberDue& effect);
  void run(const ServiceChanged& effect);
  void run(const PaceDue& effect);
  void run(const PaceEnded& effect);
  void run(const RetainedDropped& effect);
  void run(const SubscribersChanged& effect);
  void run(const CloseDue& effect);
  void run(const StateDue& effect);
  void run(const NameLossDue& effect);
  [[nodiscard]] const Session* find(NodeIndex node) const {
    return parts_.membership.sessions().find(node);
  }
  void send(const Session& session, const proto::Payload& payload, SendControlCommand command = {});
  [[nodiscard]] GroupId group_id(GroupIndex group) const;

  const Parts parts_;
  Tellings tellings_;
  std::uint64_t to_tell_ = 0;  ///< subscribers, in this step
};

}  // namespace gimnet::hub
