#include "hub/shard/shard_state.hpp"

#include <algorithm>

namespace gimnet::hub {
ShardState::ShardState(ShardIndex index, const HubShared& hub_shared)
    : self(index),
      shared(hub_shared),
      limits(hub_shared.limits),
      counters(*hub_shared.counters[index.value()]),
      sessions(*hub_shared.sessions[index.value()]),
      budget(hub_shared.budget),
      link_budget(hub_shared.link_budget),
      pool(static_cast<std::uint32_t>(hub_shared.limits.frame_bytes), budget),
      pieces(budget),
      link_pieces(link_budget),
      drops(tally, hub_shared.limits.report_interval_ms, hub_shared.limits.reports),
      signals(*this),
      egress{.limits = limits,
             .pool = pool,
             .memory = {{{budget, pieces}, {link_budget, link_pieces}}},
             .tally = tally,
             .drops = drops,
             .signals = signals,
             .hub = hub_shared.hub},
      fanout(index, hub_shared.mailboxes, recipients, egress,
             {hub_shared.nodes, hub_shared.groups}),
      pacer(fanout),
      retained(hub_shared.groups, fanout, pacer, hub_shared.retained_budget),
      router(hub_shared.hub,
             {hub_shared.nodes, hub_shared.groups, hub_shared.routes, fanout, pacer, retained}),
      receive_buffer(
          pool, tally,
          // Each shard keeps its part of all begun frames, and at least one: in a slab of its own.
          std::max(hub_shared.limits.partial_bytes / hub_shared.mailboxes.size(),
                   pool.slab_bytes())),
      gate(limits, tally) {}

Connection* ShardState::find(SessionRef session) const {
  if (session.slot.value() >= connections.size()) return nullptr;
  Connection* connection = connections[session.slot.value()].get();
  return connection != nullptr && connection->generation == session.generation ? connection
                                                                               : nullptr;
}

Connection* ShardState::find(NodeId node) const {
  const NodePlace place = router.place_of(node);
  if (!place.exists() || place.shard != self) return nullptr;
  return find(SessionRef{place.slot, place.generation});
}

}  // namespace gimnet::hub
