#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "proto/control/ns.hpp"
#include "proto/control/route.hpp"

// The messages of ROUTE frames by which every hub gets a copy of the names of all hubs
// (docs/protocol.md, section 10, "Names"). Thread safety: value types.

namespace gimnet::proto::route {

/// A NAMES message is not larger.
inline constexpr std::size_t kNamesBytesMax = 10 * 1024;
/// A record in it is not larger.
inline constexpr std::size_t kNameRecordBytesMax = 512;
/// Entries of one NAMES_KNOWN.
inline constexpr std::size_t kNamesKnownMax = 512;
/// NAMES messages that may be under way on a link.
inline constexpr std::size_t kNamesWindow = 4;

/// The rank of a claim that follows no other one. There is room below it: a node that shows nothing
/// but its former id has the rank below that of its former claim.
inline constexpr std::uint32_t kOrdinaryRank = 65'536;

/// The state of a name at its hub.
enum class NameState : std::uint8_t {
  held = 0,
  away = 1,     ///< its node has lost its connection: a newcomer may take it
  deleted = 2,  ///< a mark for those that have the name
};

/// A service as the other hubs have to know it.
struct ServiceClaim {
  GroupId group;
  std::uint64_t session = 0;  ///< of its provider
  std::uint32_t message_type = 0;
  std::uint32_t instance = 0;
  std::uint32_t window = 0;  ///< n of delivery sync(n)
  ns::Direction direction = ns::Direction::provides;
  ns::Delivery delivery = ns::Delivery::stream;
  bool retain = false;
  friend bool operator==(const ServiceClaim&, const ServiceClaim&) = default;
};

/// A hub's words about one of its names: that of a node, or the full name of a service.
struct NameClaim {
  std::uint64_t version = 0;  ///< of the hub's names, when this changed last
  NodeId node;                ///< that has the name, or provides the service
  std::uint32_t rank = kOrdinaryRank;
  NameState state = NameState::held;
  std::optional<ServiceClaim> service;
  friend bool operator==(const NameClaim&, const NameClaim&) = default;
};
struct NameRecord {
  std::string name;
  NameClaim claim;
  friend bool operator==(const NameRecord&, const NameRecord&) = default;
};

/// For each hub: up to which version the sender's copy of its names is complete. It asks for what
/// is newer.
struct NamesKnown {
  static constexpr std::uint16_t kOperation =
      static_cast<std::uint16_t>(RouteOperation::names_known);
  static constexpr const char* kName = "NAMES_KNOWN";
  struct Entry {
    HubId hub;
    HubInstance instance;
    std::uint64_t version = 0;
    friend bool operator==(const Entry&, const Entry&) = default;
  };
  std::vector<Entry> hubs;
  /// REQUIRES: at most kNamesKnownMax hubs.
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static NamesKnown read(Fields& fields);
  friend bool operator==(const NamesKnown&, const NamesKnown&) = default;
};

/// All names of one hub that changed last in (after, version], as they are now.
struct Names {
  static constexpr std::uint16_t kOperation = static_cast<std::uint16_t>(RouteOperation::names);
  static constexpr const char* kName = "NAMES";
  HubId hub;
  HubInstance instance;
  std::uint64_t after = 0;
  std::uint64_t version = 0;
  std::uint64_t forgotten = 0;      ///< marks of deleted names up to this version may be missing
  std::vector<NameRecord> records;  ///< by ascending version
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static Names read(Fields& fields);
  friend bool operator==(const Names&, const Names&) = default;
};

/// So many NAMES were taken: as many more may come.
struct NamesTaken {
  static constexpr std::uint16_t kOperation =
      static_cast<std::uint16_t>(RouteOperation::names_taken);
  static constexpr const char* kName = "NAMES_TAKEN";
  std::uint32_t messages = 1;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static NamesTaken read(Fields& fields);
  friend bool operator==(const NamesTaken&, const NamesTaken&) = default;
};

}  // namespace gimnet::proto::route
