#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "gimnet/gimi/message.hpp"
#include "gimnet/gimi/namespace.hpp"

// The records of a hub, its nodes and its services. Value types.

namespace gimnet::inline GIMNET_GIMI_NAMESPACE {

/// A way to deliver: `stream` every message, in order, the oldest going when its queue at the
/// hub is full; `latest` only the newest of those that wait; `sync` at most a window of messages
/// that it has not taken, its hub holding the newest meanwhile, so that each subscriber gets fresh
/// ones at its own rate.
enum class Delivery : std::int32_t { stream = 0, latest = 1, sync = 2 };

/// A service gives data to its subscribers, or takes data that others send to it.
enum class Direction : std::int32_t { provides = 0, accepts = 1 };

struct NodeRecord {
  Peer node;
  std::string name;  ///< "" for a node without a name
  std::uint32_t hub_id = 0;
  std::string hub_name;
  bool connected = false;  ///< false: within its grace time
  std::string description;
  std::string place;            ///< its address as its hub sees it
  std::uint64_t joined_ms = 0;  ///< milliseconds since it joined
  std::uint32_t services = 0;   ///< how many it provides or accepts
};

struct ServiceRecord {
  std::string name;  ///< in full: node name/service name
  Peer node;         ///< of the provider
  MessageKey key;
  Direction direction = Direction::provides;
  Delivery delivery = Delivery::stream;
  std::uint32_t group_id = 0;
  std::uint32_t subscribers = 0;
  std::string metadata;
  std::string hub_name;
  std::uint32_t window = 0;  ///< of delivery sync
  bool retain = false;       ///< a new subscriber gets the last message first
  /// Messages that subscribers at the asked hub missed, as they say. A watch does not tell it.
  std::uint64_t missed = 0;
  Peer missed_most;  ///< the one of them that missed most; 0: nobody did

  /// It answers requests.
  [[nodiscard]] bool answers() const {
    return direction == Direction::accepts && key.type == GIMI_REQUEST_TYPE;
  }
};

/// The kinds of events of a watch.
enum class Change : std::int32_t {
  snapshot_begins =
      0,              ///< all told before is void: at first, and when the watch was too far behind
  present = 1,        ///< part of the snapshot
  snapshot_ends = 2,  ///< all that is there was told; changes follow
  joined = 3,
  left = 4,  ///< a node, for good: only its id, name and hub id are told
  away = 5,  ///< a node whose connection broke: its grace time runs
  back = 6,
  renamed = 7,
  changed = 8,  ///< something else of the record
  advertised = 9,
  withdrawn = 10,  ///< a service: only its name, group id and node are told
  ended = 255,     ///< after a reconnect the hub did not take the watch again; `why` tells
};
/// "joined" and so on; "unknown" for a change of a later version. Static.
[[nodiscard]] inline std::string_view change_text(Change change) {
  return gimi_change_text(static_cast<gimi_change>(change));
}

/// A node or a service that is there or changed, or neither for what is about the watch itself.
struct WatchEvent {
  Change change = Change::snapshot_begins;
  std::optional<NodeRecord> node;
  std::optional<ServiceRecord> service;
  std::string former_name;  ///< of a node that was renamed
  std::uint32_t hub_id = 0;
  std::uint64_t epoch = 0;    ///< of the hub's versions: another one after it was started again
  std::uint64_t version = 0;  ///< of the hub's names and services after this change
  std::string why;            ///< of Change::ended
};

struct HubRecord {
  std::uint32_t hub_id = 0;
  std::string name;
  std::string version;
  std::uint32_t shards = 0;
  std::uint64_t uptime_ms = 0;
  std::uint32_t nodes = 0;
  std::uint32_t services = 0;
};

/// The counters of one of the hub's io threads, by the names of docs/operations.md, in the hub's
/// order.
struct ShardCounts {
  /// The number of the record that is no io thread's: what the hub counted of peers that it did not
  /// admit. It is there once there is something to count.
  static constexpr std::uint32_t kConductor = 65'535;

  std::uint32_t shard = 0;  ///< or kConductor
  std::vector<std::pair<std::string, std::uint64_t>> counters;
};

/// A key of the hub's configuration whose value is another one now, as its file writes them.
struct HubChange {
  std::string key;
  std::string from;
  std::string to;
  bool needs_restart = false;  ///< `from` stays in force until then
};

/// A hub that this hub knows, itself among them, and the way to it.
struct NetworkHub {
  /// A link of that hub, as it tells.
  struct Edge {
    std::uint32_t hub_id = 0;
    std::uint32_t cost = 0;
  };
  std::uint32_t hub_id = 0;
  std::string name;
  std::string version;
  std::uint32_t distance = 0;  ///< links on the way; 0: the hub that was asked
  std::uint32_t cost = 0;      ///< of the way
  std::uint32_t next_hop = 0;  ///< itself for the hub that was asked; 0: there is no way
  std::uint32_t nodes = 0;     ///< 0 of another hub also where they are not known
  std::uint32_t services = 0;  ///< the same
  bool reachable = false;
  bool too_far = false;  ///< reachable, but over more links than a message may cross
  std::vector<Edge> edges;
};

/// When one hub had a message, by that hub's clock, in ns since 1970.
struct TraceHop {
  std::uint32_t hub_id = 0;
  std::int64_t arrival_ns = 0;
  std::int64_t departure_ns = 0;
};

/// A ping whose answer was traced.
struct TracedPing {
  std::int64_t round_trip_ns = 0;
  /// The hubs that the answer passed, in its order, the first 8. Empty: the other library answers
  /// without a trace.
  std::vector<TraceHop> way_back;
};

/// A link of a hub to another one.
struct LinkRecord {
  std::string name;
  std::uint32_t hub_id = 0;          ///< at the other end; 0: not known
  std::string peer;                  ///< the URL that is dialled, or where the other side came from
  std::string state;                 ///< dialling, away, learning, standby, damped, up or ended
  bool dialled = false;              ///< by this hub
  std::uint32_t cost = 0;            ///< 0: not measured yet
  std::uint32_t rtt_us = 0;          ///< 0: none yet
  std::int64_t clock_offset_ns = 0;  ///< the other hub's clock minus this one's
  std::uint64_t clock_error_ns = 0;  ///< of the offset; 0: it is not known
  std::uint64_t queued_bytes = 0;
  std::uint64_t sent_bytes = 0;
  std::uint64_t received_bytes = 0;
  std::uint64_t accepted = 0;    ///< messages' frames from it
  std::uint64_t delivered = 0;   ///< frames that the other side confirmed
  std::uint64_t dropped = 0;     ///< frames for it
  std::uint64_t unsure = 0;      ///< of these, those that may have arrived
  std::string last_error;        ///< "": none
  std::uint64_t queue_full = 0;  ///< of those dropped, since its queue was full
};

struct ConnectionRecord {
  Peer node;
  std::string name;
  std::uint32_t shard = 0;
  std::string transport;  ///< "tcp" or "unix"
  std::string peer;       ///< its address
  bool connected = false;
  std::uint64_t queued_bytes = 0;  ///< waiting for it at the hub
  // Since its session began, over all its connections; as the hub's counters of the same names. 0:
  // the hub is older.
  std::uint64_t accepted = 0;        ///< frames that the hub took from it
  std::uint64_t received_bytes = 0;  ///< that the hub had from it
  std::uint64_t delivered =
      0;  ///< frames handed to its connection; where resume is on, confirmed by it
  std::uint64_t sent_bytes = 0;  ///< that the hub wrote to it
  std::uint64_t dropped = 0;     ///< frames that were for it
  std::uint64_t missed = 0;      ///< messages that its subscriptions missed, as it says
  std::uint64_t queue_full = 0;  ///< of those dropped, since its queue was full
};

}  // namespace gimnet::inline GIMNET_GIMI_NAMESPACE
