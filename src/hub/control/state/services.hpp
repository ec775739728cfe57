#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "base/result.hpp"
#include "hub/control/state/effects.hpp"
#include "hub/control/state/group_proof.hpp"
#include "hub/control/state/index_pool.hpp"
#include "hub/control/state/untold_moves.hpp"
#include "hub/limits.hpp"
#include "proto/control/control_message.hpp"

namespace gimnet::hub {

/// What a provider says of its service.
struct ServiceTerms {
  std::uint32_t message_type = 0;
  std::uint32_t instance = 0;
  proto::ns::Direction direction = proto::ns::Direction::provides;
  proto::ns::Delivery delivery = proto::ns::Delivery::stream;
  std::string metadata;
  std::uint32_t window = 0;  ///< of sync(n)
  bool retain = false;
  friend bool operator==(const ServiceTerms&, const ServiceTerms&) = default;
};

struct Service {
  GroupIndex group;
  NodeIndex provider;
  ServiceTerms terms;
};

/// A full name that somebody provides, or waits for, or both.
struct Topic {
  std::string_view full_name;
  std::optional<Service> service;
  std::vector<NodeIndex> subscribers;                    ///< ascending
  std::unordered_map<NodeIndex, SubscriberTerms> terms;  ///< of those that asked for something
  /// Subscribers that changed their terms in this group: that got everything and are paced now; and
  /// that asked for a pace and do not any more. Those stay paced, without bounds: what is held for
  /// them goes before what comes.
  std::unordered_set<NodeIndex> once_plain;
  std::unordered_set<NodeIndex> once_paced;
  UntoldMoves untold;

  /// What the shards hold that subscriber to; nothing if it simply gets everything.
  [[nodiscard]] std::optional<SubscriberTerms> pace_of(NodeIndex subscriber) const;
};

/// Services and subscriptions by full name; each service owns a group. Nodes are named by index,
/// and what a node declared stays while its session lives, its grace time included. Thread safety:
/// none. Limits: services_per_node, subscriptions_per_node.
class Services {
 public:
  /// In the order of names, which no choice of names can make slow, and which finds at once all
  /// that begin alike.
  using Topics = std::map<std::string, Topic, std::less<>>;

  /// Until `returns_until` providers of before a restart may come back. `secret` proves who had a
  /// group.
  Services(HubId hub, const Limits& limits, const IndexRange& groups = {},
           std::chrono::milliseconds returns_until = {}, const Secret& secret = {});

  struct Advertised {
    GroupIndex group;
    std::uint32_t subscribers = 0;
    GroupProof proof{};  ///< for FormerGroup, from now on
  };
  /// The group that a service had before its hub or its session came back, as its provider says,
  /// or kNoGroup.
  struct FormerGroup {
    GroupIndex group;
    std::span<const std::byte> proof{};
  };
  /// A provider that advertises again what it provides keeps the group; if more than the metadata
  /// differs it gets a new one, which its subscribers are told before it is published. A service
  /// that it begins gets the `former` group if the proof is right, nobody else got it since, and
  /// nobody has it now. Errors: bad_request, taken, limit.
  [[nodiscard]] Result<Advertised, proto::Refusal> advertise(
      NodeIndex provider, std::string_view full_name, const ServiceTerms& terms,
      std::chrono::milliseconds now, Effects& effects, const FormerGroup& former);
  [[nodiscard]] Result<Advertised, proto::Refusal> advertise(NodeIndex provider,
                                                             std::string_view full_name,
                                                             const ServiceTerms& terms,
                                                             std::chrono::milliseconds now,
                                                             Effects& effects) {
    return advertise(provider, full_name, terms, now, effects, FormerGroup{});
  }
  /// Errors: not_found, denied. nullopt: done.
  [[nodiscard]] std::optional<proto::Refusal> withdraw(NodeIndex provider, GroupIndex group,
                                                       std::chrono::milliseconds now,
                                                       Effects& effects);
  /// The topic, with or without a service yet. Terms that say nothing: all that comes. Errors:
  /// bad_request, limit.
  [[nodiscard]] Result<const Topic*, proto::Refusal> subscribe(NodeIndex node_index,
                                                               std::string_view full_name,
                                                               const SubscriberTerms& terms,
                                                               Effects& effects);
  /// Errors: not_found. nullopt: done.
  [[nodiscard]] std::optional<proto::Refusal> unsubscribe(NodeIndex node_index,
                                                          std::string_view full_name,
                                                          Effects& effects);

  /// The node came back on a new connection: it will declare again what it still wants.
  void node_returned(NodeIndex node);
  /// Forgets what the node has not declared since node_returned().
  void drop_undeclared(NodeIndex node_index, std::chrono::milliseconds now, Effects& effects);
  /// Withdraws what the node provides: it has another name now.
  void node_renamed(NodeIndex node_index, std::chrono::milliseconds now, Effects& effects);
  /// The node goes on under another index, with what it declared.
  void node_renumbered(NodeIndex node_index, NodeIndex new_index, Effects& effects);
  /// The node's session is over.
  void node_left(NodeIndex node_index, std::chrono::milliseconds now, Effects& effects);

  /// What the node is to be told, since it came back: each service whose moves it may not know of,
  /// once, and where it is now. To be told again at its next return unless moves_read() came.
  [[nodiscard]] std::vector<ServiceMovedDue> untold_moves(NodeIndex node) const;
  /// The node has read what it was told of that move (ServiceMovedDue), and of those before it.
  void moves_read(NodeIndex node, std::uint64_t move);

  /// nullptr: no such group.
  [[nodiscard]] const Topic* find_group(GroupIndex group) const;
  /// Topics with a service, by ascending group index.
  [[nodiscard]] const std::map<GroupIndex, Topic*>& groups() const { return groups_; }
  [[nodiscard]] const Topics& by_name() const { return topics_; }
  /// What the node declared of that service; nothing: it has not. The pointer holds until something
  /// changes here.
  [[nodiscard]] const ServiceTerms* provided(NodeIndex node, std::string_view full_name) const;
  [[nodiscard]] std::optional<SubscriberTerms> subscribed(NodeIndex node,
                                                          std::string_view full_name) const;
  [[nodiscard]] std::size_t services_of(NodeIndex node) const;
  /// Has the node a service or a subscription?
  [[nodiscard]] bool declares(NodeIndex node) const { return nodes_.contains(node); }
  [[nodiscard]] std::size_t topics() const { return topics_.size(); }
  [[nodiscard]] IndexPool& group_indices() { return group_indices_; }
  [[nodiscard]] const IndexPool& group_indices() const { return group_indices_; }

 private:
  struct Declared {
    Topic* topic = nullptr;
    std::uint32_t life = 0;
  };
  /// What one node declared; `life` counts its connections.
  struct Node {
    std::uint32_t life = 0;
    std::vector<Declared> provides;
    std::vector<Declared> subscribes;
  };

  /// Takes out of `list` what was not declared in that life.
  [[nodiscard]] static std::vector<Declared> take_undeclared(std::vector<Declared>& list,
                                                             std::uint32_t life);
  Topic& topic(std::string_view full_name);
  void forget_if_unused(Topic& topic);
  void forget_if_idle(NodeIndex node);
  [[nodiscard]] GroupGrant grant_of(GroupIndex group, std::string_view full_name) const;
  /// Was it that service that was given the group last?
  [[nodiscard]] bool is_proven(const FormerGroup& former, std::string_view full_name) const;
  /// For a service that begins: the group that it had, or a new one.
  [[nodiscard]] std::optional<GroupIndex> take_group(const FormerGroup& former,
                                                     std::string_view full_name,
                                                     std::chrono::milliseconds now);
  void open_group(Topic& topic, const Service& service, GroupIndex old_group, Effects& effects);
  static void end_group(const Topic& topic, Effects& effects);
  static void begin_pace(const Topic& topic, NodeIndex subscriber, Effects& effects);
  static void forget_subscriber(Topic& topic, NodeIndex subscriber);
  void change_terms(Topic& topic, NodeIndex subscriber, const SubscriberTerms& terms,
                    Effects& effects);
  [[nodiscard]] static ServiceNoted service_noted(proto::ns::ChangeKind kind, const Topic& topic);
  void tell_subscribers(Topic& topic, ServiceMovedDue event, Effects& effects);
  /// In force; 0: the subscriber's messages are not counted.
  [[nodiscard]] static std::uint32_t window_of(const Topic& topic, NodeIndex subscriber);
  void close_group(Topic& topic, std::chrono::milliseconds now, Effects& effects);
  void remove_subscriber(Topic& topic, NodeIndex node, Effects& effects);

  const HubId hub_;
  const Limits& limits_;
  const Secret secret_;
  IndexPool group_indices_;
  Topics topics_;
  std::map<GroupIndex, Topic*> groups_;
  std::unordered_map<NodeIndex, Node> nodes_;
  std::uint64_t moves_ = 0;
};

}  // namespace gimnet::hub
