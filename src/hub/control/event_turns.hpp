#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <list>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "hub/shard/commands.hpp"

namespace gimnet::hub {

/// Events of nodes that the conductor has not taken yet. Nodes take turns, so that one that asks
/// much does not delay the others; the events of one node keep their order. ROUTE frames of a link
/// go with its connection: the next one begins with all of them, and there may be very many. Thread
/// safety: none. Limits: what nodes may have unanswered (limits.requests), kLinkBytesMax
/// of each link, and a few events of each connection.
class EventTurns {
 public:
  /// Frames of one link, with what each of them costs besides. An honest hub says as much at once
  /// when it tells of 4,000 hubs.
  static constexpr std::size_t kLinkBytesMax = 8 * 1024 * 1024;

  /// A frame of a link that has kLinkBytesMax waiting is dropped. REQUIRES: an event of a session,
  /// or DrainedEvent.
  void put(ShardEvent event);
  /// The hub of a link of which a frame was dropped since the last call.
  [[nodiscard]] std::optional<HubId> take_overrun() { return std::exchange(overrun_, {}); }
  /// So many frames of links were dropped since the last call.
  [[nodiscard]] std::uint64_t take_dropped() { return std::exchange(dropped_, 0); }
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
  using Events = std::list<ShardEvent>;  ///< Limit: as of the class
  struct Node {
    Events events;
    std::size_t link_bytes = 0;
    std::list<Key>::iterator turn;  ///< Limit: as of turns_
  };
  [[nodiscard]] static Key key_of(const ShardEvent& event);

  std::map<Key, Node> waiting_;  ///< none without events
  std::list<Key> turns_;         ///< of all that wait, the next one first. Limit: the nodes
  std::vector<Key> ended_;       ///< with a DetachedEvent among their events, or not any more
  Events drained_;
  std::optional<HubId> overrun_;
  std::uint64_t dropped_ = 0;
};

}  // namespace gimnet::hub
