#pragma once

#include <cstdint>
#include <memory>
#include <unordered_map>
#include <utility>
#include <vector>

#include "base/ids.hpp"
#include "hub/concurrent/quiescence.hpp"
#include "hub/data/budget.hpp"
#include "hub/data/buffer_pool.hpp"
#include "hub/data/fanout/fanout.hpp"
#include "hub/data/fanout/pacer.hpp"
#include "hub/data/fanout/retained_messages.hpp"
#include "hub/data/ingress/ingress_gate.hpp"
#include "hub/data/ingress/receive_buffer.hpp"
#include "hub/data/route/router.hpp"
#include "hub/limits.hpp"
#include "hub/observe/counters.hpp"
#include "hub/observe/session_gauges.hpp"
#include "hub/shard/commands.hpp"
#include "hub/shard/connection.hpp"
#include "hub/shard/poller.hpp"
#include "hub/shard/signals.hpp"

namespace gimnet::hub {

/// The parts that all shards of a hub share. Thread safety: immutable, apart from members that say
/// otherwise. Lifetime: longer than any shard.
struct HubShared {
  HubId hub;
  const Limits& limits;
  const NodeTable& nodes;
  const GroupTable& groups;
  const RouteTable& routes;
  Quiescence& quiescence;
  Budget& budget;
  Budget& link_budget;
  Budget& retained_budget;
  ControlInbox& inbox;
  std::vector<Mailbox*> mailboxes;       ///< by shard
  std::vector<Waker*> wakers;            ///< by shard
  std::vector<ShardCounters*> counters;  ///< by shard
  std::vector<SessionGauges*> sessions;  ///< by shard
};

/// All that a shard's parts work on. Thread safety: one shard. The members are in the order in
/// which they need each other.
struct ShardState {
  ShardState(ShardIndex index, const HubShared& hub_shared);

  const ShardIndex self;
  const HubShared& shared;
  Limits limits;  ///< this shard's own: changed between two steps of its work
  ShardCounters& counters;
  SessionGauges& sessions;
  Tally tally;
  BudgetLease budget;
  BudgetLease link_budget;
  BufferPool pool;
  PiecePool pieces;
  PiecePool link_pieces;
  DropBook drops;
  Signals signals;
  EgressContext egress;
  RecipientTable recipients;
  Fanout fanout;
  Pacer pacer;
  RetainedMessages retained;
  Router router;
  ReceiveBuffer receive_buffer;
  IngressGate gate;
  Poller poller;
  std::vector<std::unique_ptr<Connection>> connections;  ///< by slot
  std::vector<Connection*> waiting_for_room;
  std::vector<std::uint64_t>
      with_rest;  ///< tokens of connections that go on without the poller, by age: their last read
                  ///< was not routed whole, their stream keeps bytes, or they have just come
  std::vector<SessionRef> confirms;  ///< CONFIRM is due to them, behind what was taken from them
  std::uint64_t now_ms = 0;
  std::uint64_t done_shards = 0;  ///< bit set: they drain, and what they had handed over was taken
  bool nothing_follows =
      false;  ///< this shard drains, and so do all others: what waits is all that is to be written

  [[nodiscard]] Connection* find(SessionRef session) const;
  /// A node whose session is on this shard; nullptr if it is not.
  [[nodiscard]] Connection* find(NodeId node) const;
  /// The connection of a poller's token; nullptr if it has ended, even if another one has its slot.
  [[nodiscard]] Connection* find_token(std::uint64_t token) const {
    const std::size_t slot = token & (kSlotsMax - 1);
    Connection* connection = slot < connections.size() ? connections[slot].get() : nullptr;
    return connection != nullptr && connection->connected && connection->token() == token
               ? connection
               : nullptr;
  }
  [[nodiscard]] bool is_scarce() const { return budget.scarce() || link_budget.scarce(); }
  /// The next turn goes on with the connection, whatever the poller says.
  void go_on_later(Connection& connection) {
    if (!std::exchange(connection.goes_on, true)) with_rest.push_back(connection.token());
  }
  void tell_conductor(ShardEvent event) { shared.inbox.push(std::move(event)); }
};

}  // namespace gimnet::hub
