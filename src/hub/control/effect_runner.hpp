#pragma once

#include <chrono>

#include "hub/control/group_endings.hpp"
#include "hub/control/hub_facts.hpp"
#include "hub/control/shard_proxy.hpp"
#include "hub/control/state/effects.hpp"
#include "hub/control/state/membership.hpp"
#include "hub/control/state/watches.hpp"
#include "hub/control/state_keeper.hpp"
#include "hub/control/table_publisher.hpp"
#include "proto/control/control_message.hpp"

namespace gimnet::hub {

/// Carries out what the state machines want done: publishes tables, commands shards, tells nodes,
/// and keeps what has to outlive the hub. In the order in which they wanted it, which is part of
/// its meaning (state/effects.hpp). Thread safety: the conductor's thread only. Lifetime: all its
/// parts outlive it.
class EffectRunner {
 public:
  struct Parts {
    const HubFacts& facts;
    ShardProxy& shards;
    Membership& membership;
    Watches& watches;
    TablePublisher& publisher;
    StateKeeper& keeper;
  };
  explicit EffectRunner(const Parts& parts) : parts_(parts), endings_(parts.shards) {}

  void carry_out(const Effects& effects, std::chrono::milliseconds now);
  /// A shard has taken what another one had handed over to it.
  void fence_passed(const FencePassedEvent& event);
  /// Sends an event of kind NS; nothing to a node that is away.
  void send_event(const Session& session, const proto::Payload& payload);
  /// Adds what the node has to be told ahead of all else, since it came back: how services moved
  /// meanwhile.
  void tell_again(const Session& session, AttachCommand& command) const;

 private:
  void run(const NodeChanged& effect);
  void run(const GroupChanged& effect);
  void run(const MemberChanged& effect);
  void run(const SessionEnded& effect);
  void run(const RenumberDue& effect);
  void run(const ServiceMovedDue& effect);
  void run(const PaceDue& effect);
  void run(const PaceEnded& effect);
  void run(const RetainedDropped& effect);
  void run(const SubscriberDue& effect);
  void run(const CloseDue& effect);
  void run(const StateDue& effect);
  void run(const NameDecided& effect);
  [[nodiscard]] const Session* find(NodeIndex node) const {
    return parts_.membership.sessions().find(node);
  }
  [[nodiscard]] GroupId group_id(GroupIndex group) const;
  [[nodiscard]] proto::Payload payload_of(const ServiceMovedDue& effect) const;

  const Parts parts_;
  GroupEndings endings_;
};

}  // namespace gimnet::hub
