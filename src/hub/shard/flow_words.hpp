#pragma once

#include <cstdint>

#include "hub/shard/connection.hpp"
#include "hub/shard/shard_state.hpp"
#include "proto/frame/flow.hpp"

// The FLOW frames that a shard sends to the peer of a connection. Thread safety: one shard.

namespace gimnet::hub {

/// Tells the peer how many data frames were taken from it.
void send_confirm(ShardState& state, Connection& connection);
/// Queues a FLOW frame to the peer of this connection, to be flushed by the caller; false: no room.
[[nodiscard]] bool push_flow(ShardState& state, Connection& connection,
                             const proto::flow::Message& message);
/// The same, written with what else goes there in this turn, where there is room.
void send_flow(ShardState& state, Connection& connection, const proto::flow::Message& message);

}  // namespace gimnet::hub
