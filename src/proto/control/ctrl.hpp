#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "base/ids.hpp"
#include "proto/control/control_message.hpp"

// HubCtrl, administration: the payloads of CTRL frames (docs/protocol.md, section 9), one struct for each request and
// answer. Encode and decode with the templates of control_message.hpp.
// Thread safety: value types.

namespace gimnet::proto::ctrl {

enum class Operation : std::uint16_t { hub_info = 1, statistics = 2, connections = 3 };

[[nodiscard]] constexpr std::uint16_t request_of(Operation operation) { return static_cast<std::uint16_t>(operation); }
[[nodiscard]] constexpr std::uint16_t answer_of(Operation operation) {
  return static_cast<std::uint16_t>(request_of(operation) | kAnswerBit);
}

/// Records of one page, if the request does not say.
inline constexpr std::uint32_t kPageRecordsDefault = 256;

// HUB_INFO: who are you?

struct HubInfo {
  static constexpr std::uint16_t kOperation = request_of(Operation::hub_info);
  static constexpr const char* kName = "HUB_INFO";
  void write(bitestream::Writer&) const {}
  [[nodiscard]] static HubInfo read(Fields&) { return {}; }
  friend bool operator==(const HubInfo&, const HubInfo&) = default;
};

struct HubInfoAnswer {
  static constexpr std::uint16_t kOperation = answer_of(Operation::hub_info);
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
  static constexpr std::uint16_t kOperation = request_of(Operation::statistics);
  static constexpr const char* kName = "STATISTICS";
  void write(bitestream::Writer&) const {}
  [[nodiscard]] static Statistics read(Fields&) { return {}; }
  friend bool operator==(const Statistics&, const Statistics&) = default;
};

/// Named as in docs/operations.md; 1..255 bytes of UTF-8.
struct Counter {
  std::string name;
  std::uint64_t value = 0;
  friend bool operator==(const Counter&, const Counter&) = default;
};

/// The number of the record that is no shard's: what the conductor counted.
inline constexpr std::uint16_t kConductorRecord = 65'535;

struct ShardRecord {
  std::uint16_t shard = 0;  ///< or kConductorRecord
  std::vector<Counter> counters;
  friend bool operator==(const ShardRecord&, const ShardRecord&) = default;
};

struct StatisticsAnswer {
  static constexpr std::uint16_t kOperation = answer_of(Operation::statistics);
  static constexpr const char* kName = "answer to STATISTICS";
  std::vector<ShardRecord> shards;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static StatisticsAnswer read(Fields& fields);
  friend bool operator==(const StatisticsAnswer&, const StatisticsAnswer&) = default;
};

// CONNECTIONS: who is connected where, in pages of ascending node ids

struct Connections {
  static constexpr std::uint16_t kOperation = request_of(Operation::connections);
  static constexpr const char* kName = "CONNECTIONS";
  NodeId after;  ///< continue after this one; 0: from the start
  std::uint32_t records_max = kPageRecordsDefault;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static Connections read(Fields& fields);
  friend bool operator==(const Connections&, const Connections&) = default;
};

struct ConnectionRecord {
  NodeId node;
  std::string name;
  std::uint16_t shard = 0;
  std::string transport;  ///< "tcp" or "unix"
  std::string peer;       ///< its address
  bool connected = false;
  std::uint64_t queued_bytes = 0;
  friend bool operator==(const ConnectionRecord&, const ConnectionRecord&) = default;
};
/// Bytes that the record takes in an answer, at most: an answer has to fit in a frame.
[[nodiscard]] std::size_t page_bytes_max(const ConnectionRecord& record);

struct ConnectionsAnswer {
  static constexpr std::uint16_t kOperation = answer_of(Operation::connections);
  static constexpr const char* kName = "answer to CONNECTIONS";
  std::vector<ConnectionRecord> connections;
  bool more = false;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static ConnectionsAnswer read(Fields& fields);
  friend bool operator==(const ConnectionsAnswer&, const ConnectionsAnswer&) = default;
};

}  // namespace gimnet::proto::ctrl
