#pragma once

#include <cstdint>
#include <string>

#include "gimnet/gimi/message.hpp"
#include "gimnet/gimi/namespace.hpp"

// The state of a node's connection, and its losses. Value types.

namespace gimnet::inline GIMNET_GIMI_NAMESPACE {

/// State of a node's connection at one moment.
struct NodeState {
  Peer peer;  ///< changes only if a session could not be taken up again after a break
  std::string name;
  std::string hub_name;
  std::uint32_t hub_id = 0;
  bool connected = false;
  bool ended = false;  ///< it will not connect again; `trouble` says why
  std::uint32_t reconnects = 0;
  std::int64_t hub_round_trip_ns = 0;    ///< 0: not measured yet
  std::int64_t hub_clock_offset_ns = 0;  ///< hub's clock minus this one
  std::string trouble;                   ///< why the connection broke last; "" if it never did
  /// Messages published with `retain` that are not kept for a hub that is started again: larger
  /// than NodeOptions::last_message_bytes or, with those of other services, than 64 MiB.
  std::uint64_t last_messages_not_kept = 0;
};

/// The changes of the connection between a node and its hub.
enum class ConnectionChange : std::int32_t {
  connected = 0,       ///< the first connection
  lost = 1,            ///< the library dials again
  resumed = 2,         ///< there is one again, and the session goes on
  connected_anew = 3,  ///< there is one again; what was on its way is lost
  ended = 4,           ///< no connection will come any more
};

struct ConnectionEvent {
  ConnectionChange change = ConnectionChange::connected;
  std::uint32_t skipped = 0;  ///< events right before it that went, since 64 waited
  std::int64_t when_ns = 0;   ///< by this machine's clock, ns since 1970
  std::string why;            ///< the cause in words

  /// There is a connection now.
  [[nodiscard]] bool is_connected() const {
    return change != ConnectionChange::lost && change != ConnectionChange::ended;
  }
};

/// Losses: messages and frames that were on their way to a node and cannot be given out.
struct LostCounts {
  std::uint64_t incomplete =
      0;  ///< messages of which a part did not come, or did not fit what came before
  std::uint64_t too_large = 0;  ///< messages larger than NodeOptions::message_bytes_max
  /// Frames that the hub could not send again after a break; a small message has one, a large one
  /// many.
  std::uint64_t frames_broken_off = 0;
  /// Messages of a group that is none of a service this node subscribed, nor lately was.
  std::uint64_t unknown_service = 0;
  /// Frames of other nodes that break the protocol, and KEYED messages without a GIMI header.
  std::uint64_t unreadable = 0;
  /// Messages that came after their sender had begun the stream anew (Message::begins_stream()).
  std::uint64_t outdated = 0;
  /// Frames that the hub dropped because this node's queue there was full.
  std::uint64_t queue_full = 0;
  /// The node that had sent most of the bytes in it, whichever lost frames. Id 0: nobody, or not
  /// known.
  Peer queue_filled_by = {};
  /// Frames that the hub dropped because its memory for what waits was short: used up, or this
  /// node's share of it.
  std::uint64_t over_budget = 0;
  /// Number of known losses: messages, and frames where only those are. Without queue_full and
  /// over_budget.
  [[nodiscard]] std::uint64_t all() const {
    return incomplete + too_large + frames_broken_off + unknown_service + unreadable + outdated;
  }
};

}  // namespace gimnet::inline GIMNET_GIMI_NAMESPACE
