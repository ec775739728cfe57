#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "base/ids.hpp"
#include "proto/control/control_message.hpp"

// HubCtrl, administration: the payloads of CTRL frames (docs/protocol.md, section 9), one struct
// for each request and answer; those about the network of hubs are in ctrl_network.hpp. Encode and
// decode with the templates of control_message.hpp. Thread safety: value types.

namespace gimnet::proto::ctrl {

enum class CtrlOperation : std::uint16_t {
  hub_info = 1,
  statistics = 2,
  connections = 3,
  kick = 4,
  reassign = 5,
  drain = 6,
  reload = 7,
  log_level = 8,
  hubs = 9,
  links = 10,
  link_add = 11,
  link_remove = 12,
  link_cost = 13,
};

[[nodiscard]] constexpr std::uint16_t request_of(CtrlOperation operation) {
  return static_cast<std::uint16_t>(operation);
}
[[nodiscard]] constexpr std::uint16_t answer_of(CtrlOperation operation) {
  return static_cast<std::uint16_t>(request_of(operation) | kAnswerBit);
}

/// Operations of requests are below this.
inline constexpr std::size_t kRequestsEnd = 14;
/// The request as counters and documents name it, for example "kick"; nullptr: there is no such
/// request.
[[nodiscard]] const char* operation_name(std::uint16_t operation);

/// Records of one page, if the request does not say.
inline constexpr std::uint32_t kPageRecordsDefault = 256;

// HUB_INFO: who are you?

struct HubInfo {
  static constexpr std::uint16_t kOperation = request_of(CtrlOperation::hub_info);
  static constexpr const char* kName = "HUB_INFO";
  void write(bitestream::Writer&) const {}
  [[nodiscard]] static HubInfo read(Fields&) { return {}; }
  friend bool operator==(const HubInfo&, const HubInfo&) = default;
};

struct HubInfoAnswer {
  static constexpr std::uint16_t kOperation = answer_of(CtrlOperation::hub_info);
  static constexpr const char* kName = "answer to HUB_INFO";
  HubId hub;
  std::string hub_name;
  std::string version;
  std::uint32_t shards = 0;
  std::uint64_t uptime_ms = 0;
  std::uint32_t nodes = 0;
  std::uint32_t services = 0;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static HubInfoAnswer read(Fields& fields);
  friend bool operator==(const HubInfoAnswer&, const HubInfoAnswer&) = default;
};

// STATISTICS: every counter of every shard

struct Statistics {
  static constexpr std::uint16_t kOperation = request_of(CtrlOperation::statistics);
  static constexpr const char* kName = "STATISTICS";
  void write(bitestream::Writer&) const {}
  [[nodiscard]] static Statistics read(Fields&) { return {}; }
  friend bool operator==(const Statistics&, const Statistics&) = default;
};

/// Named as in docs/operations.md; 1..255 bytes of UTF-8.
struct CounterValue {
  std::string name;
  std::uint64_t value = 0;
  friend bool operator==(const CounterValue&, const CounterValue&) = default;
};

/// The number of the record that is no shard's: what the conductor counted.
inline constexpr std::uint16_t kConductorRecord = 65'535;

struct ShardRecord {
  std::uint16_t shard = 0;  ///< or kConductorRecord
  std::vector<CounterValue> counters;
  friend bool operator==(const ShardRecord&, const ShardRecord&) = default;
};

struct StatisticsAnswer {
  static constexpr std::uint16_t kOperation = answer_of(CtrlOperation::statistics);
  static constexpr const char* kName = "answer to STATISTICS";
  std::vector<ShardRecord> shards;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static StatisticsAnswer read(Fields& fields);
  friend bool operator==(const StatisticsAnswer&, const StatisticsAnswer&) = default;
};

// CONNECTIONS: who is connected where, in pages of ascending node ids

struct Connections {
  static constexpr std::uint16_t kOperation = request_of(CtrlOperation::connections);
  static constexpr const char* kName = "CONNECTIONS";
  NodeId after;  ///< continue after this one; 0: from the start
  std::uint32_t records_max = kPageRecordsDefault;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static Connections read(Fields& fields);
  friend bool operator==(const Connections&, const Connections&) = default;
};

/// The bytes that wait for a node now, and the counts of its session since it began, which the
/// shards count under the same names. 0 if the hub does not tell.
struct ConnectionCounts {
  std::uint64_t queued_bytes = 0;
  std::uint64_t accepted = 0;  ///< frames from it
  std::uint64_t received_bytes = 0;
  std::uint64_t delivered = 0;  ///< frames to it
  std::uint64_t sent_bytes = 0;
  std::uint64_t dropped = 0;     ///< frames to it
  std::uint64_t missed = 0;      ///< messages, as it says itself of its subscriptions
  std::uint64_t queue_full = 0;  ///< of those dropped, frames that found its queue full
  friend bool operator==(const ConnectionCounts&, const ConnectionCounts&) = default;
};

struct ConnectionRecord {
  NodeId node;
  std::string name;
  std::uint16_t shard = 0;
  std::string transport;  ///< "tcp" or "unix"
  std::string peer;       ///< its address
  bool connected = false;
  ConnectionCounts counts;
  friend bool operator==(const ConnectionRecord&, const ConnectionRecord&) = default;
};
/// Bytes that the record takes in an answer, at most: an answer has to fit in a frame.
[[nodiscard]] std::size_t page_bytes_max(const ConnectionRecord& record);

struct ConnectionsAnswer {
  static constexpr std::uint16_t kOperation = answer_of(CtrlOperation::connections);
  static constexpr const char* kName = "answer to CONNECTIONS";
  std::vector<ConnectionRecord> connections;
  bool more = false;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static ConnectionsAnswer read(Fields& fields);
  friend bool operator==(const ConnectionsAnswer&, const ConnectionsAnswer&) = default;
};

// The operations that follow change the hub. To all but administrators they are `denied`.

// KICK: ends a node's session, its connection with GOODBYE `kicked`

struct Kick {
  static constexpr std::uint16_t kOperation = request_of(CtrlOperation::kick);
  static constexpr const char* kName = "KICK";
  NodeId node;
  std::string reason;  ///< told to the node; at most 256 bytes
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static Kick read(Fields& fields);
  friend bool operator==(const Kick&, const Kick&) = default;
};

struct KickAnswer {
  static constexpr std::uint16_t kOperation = answer_of(CtrlOperation::kick);
  static constexpr const char* kName = "answer to KICK";
  std::string remark;  ///< what the hub cannot promise; "": nothing
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static KickAnswer read(Fields& fields);
  friend bool operator==(const KickAnswer&, const KickAnswer&) = default;
};

// REASSIGN: a node goes on under another id of the same hub

struct Reassign {
  static constexpr std::uint16_t kOperation = request_of(CtrlOperation::reassign);
  static constexpr const char* kName = "REASSIGN";
  NodeId node;
  NodeId new_node;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static Reassign read(Fields& fields);
  friend bool operator==(const Reassign&, const Reassign&) = default;
};

struct ReassignAnswer {
  static constexpr std::uint16_t kOperation = answer_of(CtrlOperation::reassign);
  static constexpr const char* kName = "answer to REASSIGN";
  void write(bitestream::Writer&) const {}
  [[nodiscard]] static ReassignAnswer read(Fields&) { return {}; }
  friend bool operator==(const ReassignAnswer&, const ReassignAnswer&) = default;
};

// DRAIN: the hub ends as at SIGTERM

struct Drain {
  static constexpr std::uint16_t kOperation = request_of(CtrlOperation::drain);
  static constexpr const char* kName = "DRAIN";
  void write(bitestream::Writer&) const {}
  [[nodiscard]] static Drain read(Fields&) { return {}; }
  friend bool operator==(const Drain&, const Drain&) = default;
};

struct DrainAnswer {
  static constexpr std::uint16_t kOperation = answer_of(CtrlOperation::drain);
  static constexpr const char* kName = "answer to DRAIN";
  void write(bitestream::Writer&) const {}
  [[nodiscard]] static DrainAnswer read(Fields&) { return {}; }
  friend bool operator==(const DrainAnswer&, const DrainAnswer&) = default;
};

// RELOAD: the hub reads its configuration again

struct Reload {
  static constexpr std::uint16_t kOperation = request_of(CtrlOperation::reload);
  static constexpr const char* kName = "RELOAD";
  void write(bitestream::Writer&) const {}
  [[nodiscard]] static Reload read(Fields&) { return {}; }
  friend bool operator==(const Reload&, const Reload&) = default;
};

/// A key whose value is another one now. Keys and values as a configuration file has them.
struct ChangeRecord {
  std::string key;
  std::string from;
  std::string to;
  bool needs_restart = false;  ///< the value in force is still `from`
  friend bool operator==(const ChangeRecord&, const ChangeRecord&) = default;
};

/// As page_bytes_max(ConnectionRecord).
[[nodiscard]] std::size_t page_bytes_max(const ChangeRecord& record);

struct ReloadAnswer {
  static constexpr std::uint16_t kOperation = answer_of(CtrlOperation::reload);
  static constexpr const char* kName = "answer to RELOAD";
  std::vector<ChangeRecord> changes;
  bool more = false;  ///< there were more than fit in a frame
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static ReloadAnswer read(Fields& fields);
  friend bool operator==(const ReloadAnswer&, const ReloadAnswer&) = default;
};

// LOG_LEVEL: until the next reload or start

struct SetLogLevel {
  static constexpr std::uint16_t kOperation = request_of(CtrlOperation::log_level);
  static constexpr const char* kName = "LOG_LEVEL";
  std::string level;  ///< error, warning, info, debug or off
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static SetLogLevel read(Fields& fields);
  friend bool operator==(const SetLogLevel&, const SetLogLevel&) = default;
};

struct SetLogLevelAnswer {
  static constexpr std::uint16_t kOperation = answer_of(CtrlOperation::log_level);
  static constexpr const char* kName = "answer to LOG_LEVEL";
  std::string before;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static SetLogLevelAnswer read(Fields& fields);
  friend bool operator==(const SetLogLevelAnswer&, const SetLogLevelAnswer&) = default;
};

}  // namespace gimnet::proto::ctrl
