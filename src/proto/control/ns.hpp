#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "base/ids.hpp"
#include "proto/control/control_message.hpp"

// HubNS, names and services: the payloads of NS frames (docs/protocol.md, section 8), one struct
// for each request, answer and event; those of names of one's own are in ns_register.hpp, those of
// watching in ns_watch.hpp. Encode and decode with the templates of control_message.hpp. Thread
// safety: value types. Limits: names 255 bytes, metadata 4,096, descriptions and places 256.

namespace gimnet::proto::ns {

enum class NsOperation : std::uint16_t {
  register_name = 1,
  unregister_name = 2,
  resolve = 3,
  reverse = 4,
  list = 5,
  watch = 6,
  advertise = 7,
  withdraw = 8,
  services = 9,
  subscribe = 10,
  unsubscribe = 11,
  unwatch = 12,
  watch_taken = 13,
  let_go = 14,
  service_moved = 32,
  subscribers = 33,
  name_lost = 36,
  watch_events = 37,
};

[[nodiscard]] constexpr std::uint16_t request_of(NsOperation operation) {
  return static_cast<std::uint16_t>(operation);
}
[[nodiscard]] constexpr std::uint16_t answer_of(NsOperation operation) {
  return static_cast<std::uint16_t>(request_of(operation) | kAnswerBit);
}

/// Operations of requests are below this, those of events above.
inline constexpr std::size_t kRequestsEnd = 32;
/// The request as counters and documents name it, for example "resolve"; nullptr: there is no such
/// request.
[[nodiscard]] const char* operation_name(std::uint16_t operation);

enum class Direction : std::uint8_t { provides = 0, accepts = 1 };
enum class Delivery : std::uint8_t { stream = 0, latest = 1, sync = 2 };

/// Records of one page, if the request does not say.
inline constexpr std::uint32_t kPageRecordsDefault = 256;

// RESOLVE: which node has that name?

struct Resolve {
  static constexpr std::uint16_t kOperation = request_of(NsOperation::resolve);
  static constexpr const char* kName = "RESOLVE";
  std::string name;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static Resolve read(Fields& fields);
  friend bool operator==(const Resolve&, const Resolve&) = default;
};

/// A name as those see it that ask for it.
enum class NameStanding : std::uint8_t {
  held = 0,
  away = 1,         ///< its node has lost its connection: a newcomer may take the name
  unreachable = 2,  ///< its hub cannot be reached, or has restarted: nobody may take it for a while
};

struct ResolveAnswer {
  static constexpr std::uint16_t kOperation = answer_of(NsOperation::resolve);
  static constexpr const char* kName = "answer to RESOLVE";
  NodeId node;
  NameStanding standing = NameStanding::held;  ///< as sent: may be a value that is not listed
  bool learning = false;                       ///< names of other hubs may be on their way
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static ResolveAnswer read(Fields& fields);
  friend bool operator==(const ResolveAnswer&, const ResolveAnswer&) = default;
};

// REVERSE: which name has that node?

struct Reverse {
  static constexpr std::uint16_t kOperation = request_of(NsOperation::reverse);
  static constexpr const char* kName = "REVERSE";
  NodeId node;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static Reverse read(Fields& fields);
  friend bool operator==(const Reverse&, const Reverse&) = default;
};

struct ReverseAnswer {
  static constexpr std::uint16_t kOperation = answer_of(NsOperation::reverse);
  static constexpr const char* kName = "answer to REVERSE";
  std::string name;  ///< empty: the node has none
  NodeId node;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static ReverseAnswer read(Fields& fields);
  friend bool operator==(const ReverseAnswer&, const ReverseAnswer&) = default;
};

// LIST: nodes by pattern, in pages of ascending ids

struct List {
  static constexpr std::uint16_t kOperation = request_of(NsOperation::list);
  static constexpr const char* kName = "LIST";
  std::string pattern;  ///< empty: all
  NodeId after;         ///< continue after this one; 0: from the start
  std::uint32_t records_max = kPageRecordsDefault;
  bool connected_only = false;  ///< none within their grace time
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static List read(Fields& fields);
  friend bool operator==(const List&, const List&) = default;
};

struct NodeRecord {
  NodeId node;
  std::string name;
  HubId hub;
  std::string hub_name;
  bool connected = false;
  std::string description;
  std::string place;            ///< address of the peer
  std::uint64_t joined_ms = 0;  ///< ms since it joined
  std::uint32_t services = 0;   ///< provided
  friend bool operator==(const NodeRecord&, const NodeRecord&) = default;
};
/// Bytes that the record takes in an answer, at most: an answer has to fit in a frame.
[[nodiscard]] std::size_t page_bytes_max(const NodeRecord& record);
/// The record's values; the caller begins and ends what they are nested in.
void write_record(bitestream::Writer& writer, const NodeRecord& record);
[[nodiscard]] NodeRecord read_node_record(Fields& fields);

struct ListAnswer {
  static constexpr std::uint16_t kOperation = answer_of(NsOperation::list);
  static constexpr const char* kName = "answer to LIST";
  std::vector<NodeRecord> nodes;  ///< may be none though there are more
  bool more = false;
  NodeId next;  ///< if there are more: continue after this one
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static ListAnswer read(Fields& fields);
  friend bool operator==(const ListAnswer&, const ListAnswer&) = default;
};

// ADVERTISE and WITHDRAW: a service of mine

struct Advertise {
  static constexpr std::uint16_t kOperation = request_of(NsOperation::advertise);
  static constexpr const char* kName = "ADVERTISE";
  std::string service;  ///< within the node, without '/'
  std::uint32_t message_type = 0;
  std::uint32_t instance = 0;
  Direction direction = Direction::provides;
  Delivery delivery = Delivery::stream;
  std::string metadata;
  std::uint32_t window = 0;  ///< n of delivery sync(n)
  bool retain = false;       ///< the hub keeps the last message for new subscribers
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static Advertise read(Fields& fields);
  friend bool operator==(const Advertise&, const Advertise&) = default;
};

struct AdvertiseAnswer {
  static constexpr std::uint16_t kOperation = answer_of(NsOperation::advertise);
  static constexpr const char* kName = "answer to ADVERTISE";
  GroupId group;
  std::uint32_t subscribers = 0;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static AdvertiseAnswer read(Fields& fields);
  friend bool operator==(const AdvertiseAnswer&, const AdvertiseAnswer&) = default;
};

struct Withdraw {
  static constexpr std::uint16_t kOperation = request_of(NsOperation::withdraw);
  static constexpr const char* kName = "WITHDRAW";
  GroupId group;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static Withdraw read(Fields& fields);
  friend bool operator==(const Withdraw&, const Withdraw&) = default;
};

struct WithdrawAnswer {
  static constexpr std::uint16_t kOperation = answer_of(NsOperation::withdraw);
  static constexpr const char* kName = "answer to WITHDRAW";
  void write(bitestream::Writer&) const {}
  [[nodiscard]] static WithdrawAnswer read(Fields&) { return {}; }
  friend bool operator==(const WithdrawAnswer&, const WithdrawAnswer&) = default;
};

// SERVICES: services by pattern over their full names, in pages of ascending group ids

struct ServicesRequest {
  static constexpr std::uint16_t kOperation = request_of(NsOperation::services);
  static constexpr const char* kName = "SERVICES";
  std::string pattern;  ///< empty: all
  GroupId after;        ///< continue after this one; 0: from the start
  std::uint32_t records_max = kPageRecordsDefault;
  /// Besides the hub's own services only those of which its subscribers missed messages.
  bool missed = false;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static ServicesRequest read(Fields& fields);
  friend bool operator==(const ServicesRequest&, const ServicesRequest&) = default;
};

struct ServiceRecord {
  GroupId group;
  std::string name;  ///< full
  NodeId node;
  std::uint32_t message_type = 0;
  std::uint32_t instance = 0;
  Direction direction = Direction::provides;  ///< as sent: may be a value that is not listed
  Delivery delivery = Delivery::stream;       ///< as sent: may be a value that is not listed
  std::string metadata;
  std::uint32_t subscribers = 0;
  std::string hub_name;
  std::uint32_t window = 0;  ///< n of delivery sync(n)
  bool retain = false;
  std::uint64_t missed = 0;  ///< by the subscribers at the hub that answers
  NodeId missed_most;        ///< the one of them that missed most
  friend bool operator==(const ServiceRecord&, const ServiceRecord&) = default;
};
/// Bytes that the record takes in an answer, at most: an answer has to fit in a frame.
[[nodiscard]] std::size_t page_bytes_max(const ServiceRecord& record);
void write_record(bitestream::Writer& writer, const ServiceRecord& record);
[[nodiscard]] ServiceRecord read_service_record(Fields& fields);

struct ServicesAnswer {
  static constexpr std::uint16_t kOperation = answer_of(NsOperation::services);
  static constexpr const char* kName = "answer to SERVICES";
  std::vector<ServiceRecord> services;  ///< may be none though there are more
  bool more = false;
  GroupId next;  ///< if there are more: continue after this one
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static ServicesAnswer read(Fields& fields);
  friend bool operator==(const ServicesAnswer&, const ServicesAnswer&) = default;
};

// SUBSCRIBE and UNSUBSCRIBE: a service by its full name, which need not exist yet

struct Subscribe {
  static constexpr std::uint16_t kOperation = request_of(NsOperation::subscribe);
  static constexpr const char* kName = "SUBSCRIBE";
  std::string name;
  std::uint32_t window =
      0;  ///< of a service with sync(n): at most so many uncredited, n at most; 0: n
  std::uint32_t depth = 1;  ///< newest messages that the hub holds for it
  double rate_hz = 0.0;     ///< messages a second at most; 0: no bound
  /// Of the subscription's counts: another one than that of the last SUBSCRIBE of this name begins
  /// them anew.
  std::uint8_t number = 0;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static Subscribe read(Fields& fields);
  friend bool operator==(const Subscribe&, const Subscribe&) = default;
};

/// The present state of a service, as its subscribers are told.
struct ServiceState {
  GroupId group;              ///< 0: none
  NodeId provider;            ///< 0: nobody
  std::uint64_t session = 0;  ///< of the provider: another one at each new session of a node
  std::uint32_t message_type = 0;
  std::uint32_t instance = 0;
  Delivery delivery = Delivery::stream;  ///< as sent: may be a value that is not listed
  std::uint32_t window = 0;  ///< in force: messages that may be uncredited; 0: none is credited
  bool retain = false;
  Direction direction =
      Direction::provides;  ///< as sent; accepts: nothing will come, but it can be sent to
  /// It accepts, and its node has lost its connection and not advertised it again since.
  bool away = false;
  void write_state(bitestream::Writer& writer) const;
  void read_state(Fields& fields);
  friend bool operator==(const ServiceState&, const ServiceState&) = default;
};

struct SubscribeAnswer : ServiceState {
  static constexpr std::uint16_t kOperation = answer_of(NsOperation::subscribe);
  static constexpr const char* kName = "answer to SUBSCRIBE";
  std::uint8_t number = 0;  ///< as asked
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static SubscribeAnswer read(Fields& fields);
  friend bool operator==(const SubscribeAnswer&, const SubscribeAnswer&) = default;
};

struct Unsubscribe {
  static constexpr std::uint16_t kOperation = request_of(NsOperation::unsubscribe);
  static constexpr const char* kName = "UNSUBSCRIBE";
  std::string name;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static Unsubscribe read(Fields& fields);
  friend bool operator==(const Unsubscribe&, const Unsubscribe&) = default;
};

struct UnsubscribeAnswer {
  static constexpr std::uint16_t kOperation = answer_of(NsOperation::unsubscribe);
  static constexpr const char* kName = "answer to UNSUBSCRIBE";
  void write(bitestream::Writer&) const {}
  [[nodiscard]] static UnsubscribeAnswer read(Fields&) { return {}; }
  friend bool operator==(const UnsubscribeAnswer&, const UnsubscribeAnswer&) = default;
};

// Events

/// To subscribers, before the first frame under another group id, and whenever the provider or the
/// terms changed: the state of that moment.
struct ServiceMoved : ServiceState {
  static constexpr std::uint16_t kOperation = request_of(NsOperation::service_moved);
  static constexpr const char* kName = "SERVICE_MOVED";
  std::string name;  ///< full
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static ServiceMoved read(Fields& fields);
  friend bool operator==(const ServiceMoved&, const ServiceMoved&) = default;
};

/// Tells a provider the present number of its service's subscribers.
struct Subscribers {
  static constexpr std::uint16_t kOperation = request_of(NsOperation::subscribers);
  static constexpr const char* kName = "SUBSCRIBERS";
  GroupId group;
  std::uint32_t subscribers = 0;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static Subscribers read(Fields& fields);
  friend bool operator==(const Subscribers&, const Subscribers&) = default;
};

}  // namespace gimnet::proto::ns
