#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <list>
#include <map>
#include <vector>

#include "hub/shard/commands.hpp"

namespace gimnet::hub {

/// Events of nodes that the conductor has not taken yet. Nodes take turns, so that one that asks
/// much does not delay the others; the events of one node keep their order. Thread safety: none.
/// Limits: what nodes may have unanswered (limits.requests), and a few events of each connection.
class EventTurns {
 public:
  /// REQUIRES: an event of a session, or DrainedEvent.
  void put(ShardEvent event);
  [[nodiscard]] bool empty() const { return waiting_.empty() && drained_.empty(); }
  /// The next event of the node whose turn it is. DrainedEvent comes after all others. REQUIRES:
  /// not empty().
  [[nodiscard]] ShardEvent take();
  /// All events of the nodes whose connections ended, without a turn.
  [[nodiscard]] std::vector<ShardEvent> take_ended();

 private:
  /// A session of one shard.
  struct Key {
    std::uint32_t shard = 0;
    std::uint32_t slot = 0;
    std::uint32_t generation = 0;
    friend auto operator<=>(const Key&, const Key&) = default;
  };
  using Events = std::list<ShardEvent>;  ///< Limit: limits.requests, and a few
  struct Node {
    Events events;
    std::list<Key>::iterator turn;  ///< Limit: as of turns_
  };
  [[nodiscard]] static Key key_of(const ShardEvent& event);

  std::map<Key, Node> waiting_;  ///< none without events
  std::list<Key> turns_;         ///< of all that wait, the next one first. Limit: the nodes
  std::vector<Key> ended_;       ///< with a DetachedEvent among their events, or not any more
  Events drained_;
};

}  // namespace gimnet::hub
