#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "base/ids.hpp"
#include "proto/control/ctrl.hpp"

// HubCtrl, the network of hubs: the payloads of CTRL frames that show and change it
// (docs/protocol.md, section 9). Encode and decode with the templates of control_message.hpp.
// Thread safety: value types.

namespace gimnet::proto::ctrl {

// HUBS: the hubs that this one knows, itself among them, and the way to each, in pages of ascending
// hub ids

struct Hubs {
  static constexpr std::uint16_t kOperation = request_of(CtrlOperation::hubs);
  static constexpr const char* kName = "HUBS";
  HubId after;  ///< continue after this one; 0: from the start
  std::uint32_t records_max = kPageRecordsDefault;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static Hubs read(Fields& fields);
  friend bool operator==(const Hubs&, const Hubs&) = default;
};

/// A link of a hub, as that hub tells it.
struct HubEdge {
  HubId hub;
  std::uint16_t cost = 0;
  friend bool operator==(const HubEdge&, const HubEdge&) = default;
};
inline constexpr std::size_t kHubEdgesMax = 4'096;

struct HubRecord {
  HubId hub;
  std::string hub_name;
  HubId next_hop;          ///< itself for the own hub; 0: there is no way
  std::uint32_t cost = 0;  ///< 0 for the own hub
  std::uint32_t nodes = 0;
  std::uint32_t services = 0;
  std::uint16_t distance = 0;  ///< links on the way
  bool reachable = true;
  bool too_far = false;  ///< reachable, but over more links than a frame may cross
  std::string version;
  std::vector<HubEdge> edges{};
  friend bool operator==(const HubRecord&, const HubRecord&) = default;
};
/// As page_bytes_max(ConnectionRecord).
[[nodiscard]] std::size_t page_bytes_max(const HubRecord& record);

struct HubsAnswer {
  static constexpr std::uint16_t kOperation = answer_of(CtrlOperation::hubs);
  static constexpr const char* kName = "answer to HUBS";
  std::vector<HubRecord> hubs;
  bool more = false;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static HubsAnswer read(Fields& fields);
  friend bool operator==(const HubsAnswer&, const HubsAnswer&) = default;
};

// LINKS: the links of this hub, in pages

struct LinksRequest {
  static constexpr std::uint16_t kOperation = request_of(CtrlOperation::links);
  static constexpr const char* kName = "LINKS";
  std::uint32_t skip = 0;  ///< records of earlier pages
  std::uint32_t records_max = kPageRecordsDefault;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static LinksRequest read(Fields& fields);
  friend bool operator==(const LinksRequest&, const LinksRequest&) = default;
};

enum class LinkState : std::uint16_t {
  dialling = 0,  ///< there is no connection; this hub dials
  away = 1,      ///< the connection broke, and may be resumed
  learning = 2,  ///< connected; the records of the other side have not come, or no route is known
  standby = 3,   ///< up, while another link to the same hub carries
  damped = 4,    ///< up at the highest cost, since it broke too often
  up = 5,
  ended = 6,  ///< the other side dialled it, and does so no more
};
/// The state as documents and tools print it, for example "up"; "unknown" for another value.
[[nodiscard]] const char* link_state_name(LinkState state);

/// Counts of a link; but for the first, over all its connections, since both hubs began to count.
struct LinkCounts {
  std::uint64_t queued_bytes = 0;
  std::uint64_t sent_bytes = 0;
  std::uint64_t received_bytes = 0;
  std::uint64_t accepted = 0;    ///< data frames from it
  std::uint64_t delivered = 0;   ///< data frames that the other side confirmed
  std::uint64_t dropped = 0;     ///< data frames for it
  std::uint64_t unsure = 0;      ///< of these, those that may have arrived
  std::uint64_t queue_full = 0;  ///< of those dropped, those that found its queue full
  friend bool operator==(const LinkCounts&, const LinkCounts&) = default;
};

struct LinkRecord {
  std::string name;
  HubId hub;         ///< at the other end; 0: not known
  std::string peer;  ///< the URL that is dialled, or where the other side came from
  LinkState state = LinkState::dialling;  ///< as sent: may be a value that is not listed
  bool dialled = false;                   ///< by this hub
  std::uint16_t cost = 0;                 ///< 0: not measured yet
  std::uint32_t rtt_us = 0;               ///< 0: none yet
  std::int64_t clock_offset_ns = 0;       ///< the other hub's clock minus this one's
  std::uint64_t clock_error_ns = 0;       ///< 0: the offset is not known
  LinkCounts counts;
  std::string last_error;
  friend bool operator==(const LinkRecord&, const LinkRecord&) = default;
};
[[nodiscard]] std::size_t page_bytes_max(const LinkRecord& record);

struct LinksAnswer {
  static constexpr std::uint16_t kOperation = answer_of(CtrlOperation::links);
  static constexpr const char* kName = "answer to LINKS";
  std::vector<LinkRecord> links;
  bool more = false;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static LinksAnswer read(Fields& fields);
  friend bool operator==(const LinksAnswer&, const LinksAnswer&) = default;
};

// The rest changes the hub: for administrators only, `denied` to everybody else.

// LINK_ADD: dials a further link until the hub ends

struct LinkAdd {
  static constexpr std::uint16_t kOperation = request_of(CtrlOperation::link_add);
  static constexpr const char* kName = "LINK_ADD";
  std::string url;
  std::string name;        ///< "": the URL
  std::uint16_t cost = 0;  ///< 0: measured
  std::string proxy{};     ///< the URL of an HTTP proxy, maybe with a password; "": none
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static LinkAdd read(Fields& fields);
  friend bool operator==(const LinkAdd&, const LinkAdd&) = default;
};

// LINK_REMOVE: ends a link and dials it no more

struct LinkRemove {
  static constexpr std::uint16_t kOperation = request_of(CtrlOperation::link_remove);
  static constexpr const char* kName = "LINK_REMOVE";
  std::string name;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static LinkRemove read(Fields& fields);
  friend bool operator==(const LinkRemove&, const LinkRemove&) = default;
};

// LINK_COST: fixes the cost of a dialled link

struct SetLinkCost {
  static constexpr std::uint16_t kOperation = request_of(CtrlOperation::link_cost);
  static constexpr const char* kName = "LINK_COST";
  std::string name;
  std::uint16_t cost = 0;  ///< 0: measured
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static SetLinkCost read(Fields& fields);
  friend bool operator==(const SetLinkCost&, const SetLinkCost&) = default;
};

/// The answer to one of the last three.
template <class Request>
struct LinkChanged {
  static constexpr std::uint16_t kOperation = Request::kOperation | kAnswerBit;
  static constexpr const char* kName = "answer about a link";
  void write(bitestream::Writer&) const {}
  [[nodiscard]] static LinkChanged read(Fields&) { return {}; }
  friend bool operator==(const LinkChanged&, const LinkChanged&) = default;
};

}  // namespace gimnet::proto::ctrl
