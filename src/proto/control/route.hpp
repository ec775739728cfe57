#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "proto/control/control_message.hpp"
#include "proto/control/hub_identity.hpp"

// The messages of ROUTE frames, which hubs send to their neighbours over a link (docs/protocol.md,
// section 10). Encode and decode with encode() and decode<>() of control_message.hpp.
// Thread safety: value types and pure functions.

namespace gimnet::proto::route {

enum class RouteOperation : std::uint16_t {
  record = 1,
  records_end = 2,
  keep_alive = 3,
  names_known = 4,
  names = 5,
  names_taken = 6,
  join = 7,
  leave = 8,
  joins_end = 9,
  joined = 10,
};

/// A part has at most so many neighbours, and a record at most so many parts: the hub in the middle
/// of a star of all hubs has 4,093 neighbours.
inline constexpr std::size_t kNeighboursMax = 64;
inline constexpr std::uint16_t kPartsMax = 64;
/// A part as a whole, with keys that this version does not know: twice what it can have today.
inline constexpr std::size_t kPartBytesMax = 4096;

/// Is that the id of a hub, and not of none?
[[nodiscard]] inline bool names_a_hub(HubId hub) {
  return hub != kOwnHub && hub.value() <= kHubIdMax;
}

/// A hub at the other end of a link. Of several links to it the cheapest counts.
struct Neighbour {
  HubKey hub;
  std::uint16_t cost = 1;  ///< 1..65,535
  friend bool operator==(const Neighbour&, const Neighbour&) = default;
};

/// One part of a hub's record: the hub says of itself which neighbours it has. Other hubs pass the
/// bytes on as they came, since a later version may have more keys.
struct RecordPart {
  static constexpr std::uint16_t kOperation = static_cast<std::uint16_t>(RouteOperation::record);
  static constexpr const char* kName = "RECORD";

  HubKey hub;
  HubInstance instance;
  bool configured = false;     ///< its hub id was configured, and not drawn
  std::uint16_t part = 0;      ///< 0..63
  std::uint64_t sequence = 0;  ///< all parts of a hub share one counter
  // Only in part 0:
  HubInstance behind;          ///< the instance that the hub last went on behind; 0: none
  std::string name;            ///< of the hub
  std::string version;         ///< of its program, for people
  std::uint64_t features = 0;  ///< offered
  std::uint64_t features_required = 0;
  // In each part:
  std::vector<Neighbour> neighbours;  ///< ascending, each once

  /// REQUIRES: at most kNeighboursMax neighbours.
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static RecordPart read(Fields& fields);
  friend bool operator==(const RecordPart&, const RecordPart&) = default;
};

/// All records that this side had when the connection began are sent.
struct RecordsEnd {
  static constexpr std::uint16_t kOperation =
      static_cast<std::uint16_t>(RouteOperation::records_end);
  static constexpr const char* kName = "RECORDS_END";
  void write(bitestream::Writer&) const {}
  [[nodiscard]] static RecordsEnd read(Fields&) { return {}; }
  friend bool operator==(const RecordsEnd&, const RecordsEnd&) = default;
};

/// The keep-alive of a link. Times are in ns since 1970, by the clock of the hub that says them.
struct KeepAlive {
  static constexpr std::uint16_t kOperation =
      static_cast<std::uint16_t>(RouteOperation::keep_alive);
  static constexpr const char* kName = "KEEP_ALIVE";
  std::int64_t sent_ns = 0;
  std::int64_t heard_sent_ns = 0;  ///< `sent_ns` of the last keep-alive heard; 0: none was heard
  std::int64_t heard_ns = 0;       ///< the time when that came
  std::uint64_t taken = 0;         ///< data frames taken over this link
  std::uint64_t digest = 0;        ///< of the records of all hubs that this side can reach
  std::uint16_t cost = 0;          ///< from the side that dialled: of the link; 0: measured
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static KeepAlive read(Fields& fields);
  friend bool operator==(const KeepAlive&, const KeepAlive&) = default;
};

}  // namespace gimnet::proto::route
