#pragma once

#include <cstdint>

#include "hub/shard/connection.hpp"
#include "hub/shard/shard_state.hpp"
#include "proto/frame/flow.hpp"
#include "proto/frame/frame_parser.hpp"

// The FLOW frames that a shard sends to the peer of a connection, and the counts that they tell.
// Thread safety: one shard.

namespace gimnet::hub {

/// Tells the peer how many data frames were taken from it, once this turn has written them to their
/// recipients.
void send_confirm(ShardState& state, Connection& connection);
/// Queues that CONFIRM, to be flushed by the caller; false: no room.
[[nodiscard]] bool push_confirm(ShardState& state, Connection& connection);
/// Queues a FLOW frame to the peer of this connection, to be flushed by the caller; false: no room.
[[nodiscard]] bool push_flow(ShardState& state, Connection& connection,
                             const proto::flow::Message& message);
/// The same, written with what else goes there in this turn, where there is room.
void send_flow(ShardState& state, Connection& connection, const proto::flow::Message& message);

/// Counts data frames that were taken from a peer that keeps them until it hears so, and tells it
/// in time.
void note_taken(ShardState& state, Connection& connection, const proto::RunView& view);
/// Counts data frames that the connection sent, whatever becomes of them.
inline void count_accepted(ShardState& state, Connection& connection, const proto::RunView& view) {
  state.tally.accepted += view.frames;
  if (connection.resume) note_taken(state, connection, view);
}

/// Tells the conductor what the subscriptions of a node missed. False: the node says it more often
/// than once a second for each subscription that it may have.
[[nodiscard]] bool tell_missed(ShardState& state, Connection& connection,
                               const proto::flow::Missed& missed);

}  // namespace gimnet::hub
