#pragma once

#include <chrono>

#include "hub/control/hub_facts.hpp"
#include "hub/control/network_names.hpp"
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
    NetworkNames* names = nullptr;  ///< or none: a hub alone
  };
  explicit EffectRunner(const Parts& parts) : parts_(parts) {}

  void carry_out(const Effects& effects, std::chrono::milliseconds now);
  /// Sends an event of kind NS; nothing to a node that is away.
  void send_event(const Session& session, const proto::Payload& payload);
  /// Adds what the node has to be told ahead of all else, since it came back: the services that
  /// changed since its previous connection began.
  void tell_again(Session& session, AttachCommand& command) const;

 private:
  void run(const NodeChanged& effect);
  void run(const GroupChanged& effect);
  void run(const ProviderChanged& effect);
  void run(const MemberChanged& effect);
  void run(const SessionEnded& effect);
  void run(const RenumberDue& effect);
  void run(const ServiceMoved& effect);
  void run(const PaceDue& effect);
  void run(const PaceEnded& effect);
  void run(const RetainedDropped& effect);
  void run(const SubscribersChanged& effect);
  void run(const CloseDue& effect);
  void run(const StateDue& effect);
  void run(const NameLost& effect);
  [[nodiscard]] const Session* find(NodeIndex node) const {
    return parts_.membership.sessions().find(node);
  }
  [[nodiscard]] GroupId group_id(GroupIndex group) const;
  [[nodiscard]] proto::Payload payload_of(const Topic& topic, std::uint32_t window) const;

  const Parts parts_;
};

}  // namespace gimnet::hub
