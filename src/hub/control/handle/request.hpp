#pragma once

#include <chrono>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "hub/control/hub_facts.hpp"
#include "hub/control/network_names.hpp"
#include "hub/control/network_view.hpp"
#include "hub/control/reloading.hpp"
#include "hub/control/state/membership.hpp"
#include "hub/control/state/watches.hpp"
#include "hub/limits.hpp"
#include "hub/network/state/name_exchange.hpp"
#include "hub/observe/counters.hpp"
#include "hub/observe/request_counters.hpp"
#include "hub/observe/session_gauges.hpp"
#include "hub/shard/commands.hpp"
#include "proto/control/control_message.hpp"

namespace gimnet::hub {

/// Carries out the requests that are about the hub as a whole.
class Administration {
 public:
  virtual ~Administration() = default;
  /// Reads the configuration again; what may change has changed when this returns.
  virtual Reloading reload() = 0;
  /// The hub ends as at SIGTERM, once the answer is on its way.
  virtual void want_drain() = 0;
  virtual void log_level_set(LogLevel level) = 0;
  /// Keeps what has to outlive the hub, at once. Why that was not possible, or "".
  [[nodiscard]] virtual std::string keep_state(std::chrono::milliseconds now) = 0;
};

/// The parts of the hub that handlers work on. Valid until: the handler returns.
struct HandlerContext {
  const HubFacts& facts;
  const Limits& limits;
  Membership& membership;
  Watches& watches;
  std::span<const ShardCounters* const> counters;  ///< one per shard
  std::chrono::milliseconds now;
  Effects& effects;                                  ///< carried out before the answer leaves
  std::span<const SessionGauges* const> sessions{};  ///< one per shard, or none
  const RefusalCounters* refusals = nullptr;         ///< or none
  const RequestCounters* requests = nullptr;         ///< or none
  Administration* administration = nullptr;          ///< or none
  NetworkView* network = nullptr;                    ///< or none: a hub alone
  const NetworkNames* names = nullptr;               ///< or none: a hub alone
  std::chrono::milliseconds wall{};                  ///< since 1970
  std::optional<CountsBegin> counts{};               ///< what begins with the answer
  std::optional<GroupId> joins{};  ///< of another hub: the answer waits for its messages
};

/// A request of kind NS or CTRL. Valid until: the handler returns.
struct Request {
  const Session& session;
  proto::ControlHeader header;
  std::span<const std::byte> payload;
  bool own_only = false;  ///< it names this hub, or comes from another one: of own names alone
};

/// The payload of the answer.
using Handler = proto::Payload (*)(HandlerContext&, const Request&);

/// Reads a request of type Message, lets `grant` answer it, and writes the answer. `grant` takes
/// the message and returns a Result<its answer, proto::Refusal>.
template <class Message, class Grant>
[[nodiscard]] proto::Payload answer_to(const Request& request, Grant&& grant) {
  const Result<Message> message = proto::decode<Message>(request.payload);
  if (!message) {
    return proto::encode_refusal(request.header,
                                 {proto::Status::bad_request, message.error().sentence});
  }
  const auto answer = std::forward<Grant>(grant)(*message);
  if (!answer) return proto::encode_refusal(request.header, answer.error());
  return proto::encode_answer(*answer, request.header.request);
}

/// Counts one name, service or subscription that the node begins or changes. nullopt: it may; else
/// the answer is that it asked too often, and nothing is to change.
[[nodiscard]] std::optional<proto::Refusal> count_declaration(HandlerContext& context,
                                                              const Session& session);

/// The names of other hubs that a request is about; nullptr: none.
[[nodiscard]] inline const NameCopies* names_for(const HandlerContext& context,
                                                 const Request& request) {
  return context.names == nullptr || request.own_only ? nullptr : context.names->copies();
}

/// The room in one page of records.
class PageBudget {
 public:
  PageBudget(const Limits& limits, std::uint32_t records_wanted);
  /// Is there room for one more record of that size? Counts it if so.
  [[nodiscard]] bool take(std::size_t bytes);

 private:
  std::size_t records_;
  std::size_t bytes_;
};

/// Does that hub id stand for this hub?
[[nodiscard]] inline bool is_own(const HubFacts& facts, HubId hub) {
  return hub == kOwnHub || hub == facts.id;
}
/// The index of a node or group of this hub; nothing for those of another hub.
[[nodiscard]] inline std::optional<NodeIndex> own_index(const HubFacts& facts, NodeId node) {
  return is_own(facts, hub_of(node)) ? std::optional{node_index_of(node)} : std::nullopt;
}
[[nodiscard]] inline std::optional<GroupIndex> own_index(const HubFacts& facts, GroupId group) {
  return is_own(facts, hub_of(group)) ? std::optional{group_index_of(group)} : std::nullopt;
}

}  // namespace gimnet::hub
