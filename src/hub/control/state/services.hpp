#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "base/result.hpp"
#include "hub/control/state/effects.hpp"
#include "hub/control/state/topics.hpp"
#include "hub/limits.hpp"
#include "proto/control/control_message.hpp"
#include "proto/frame/flow.hpp"

namespace gimnet::hub {

/// The services and subscriptions that each node declared. They stay while its session lives, its
/// grace time included; a node that came back declares them again, or loses them. Thread safety:
/// none. Lifetime: the topics outlive it. Limits: services_per_node, subscriptions_per_node.
class Services {
 public:
  Services(Topics& topics, const Limits& limits) : topics_(topics), limits_(limits) {}

  struct Advertised {
    GroupIndex group;
    std::uint32_t subscribers = 0;
  };
  /// As Topics::provide(). Errors: bad_request, taken, limit.
  [[nodiscard]] Result<Advertised, proto::Refusal> advertise(NodeIndex provider,
                                                             std::string_view full_name,
                                                             const ServiceTerms& terms,
                                                             std::chrono::milliseconds now,
                                                             Effects& effects);
  /// Errors: not_found, denied. nullopt: done.
  [[nodiscard]] std::optional<proto::Refusal> withdraw(NodeIndex provider, GroupIndex group,
                                                       std::chrono::milliseconds now,
                                                       Effects& effects);
  /// The topic, with or without a service yet. Terms that say nothing: all that comes. `away`: who
  /// has it, if nobody here. Errors: bad_request, limit.
  [[nodiscard]] Result<const Topic*, proto::Refusal> subscribe(
      NodeIndex node_index, std::string_view full_name, const SubscriberTerms& terms,
      Effects& effects, const std::optional<AwayService>& away = {});
  /// Errors: not_found. nullopt: done.
  [[nodiscard]] std::optional<proto::Refusal> unsubscribe(NodeIndex node_index,
                                                          std::string_view full_name,
                                                          std::chrono::milliseconds now,
                                                          Effects& effects);

  /// The node lost its connection: what it accepts is away until it advertises that again.
  void node_away(NodeIndex node, Effects& effects);
  /// The node came back on a new connection: it will declare again what it still wants. Its former
  /// connection may not have ended before.
  void node_returned(NodeIndex node, Effects& effects);
  /// Forgets what the node has not declared since node_returned().
  void drop_undeclared(NodeIndex node_index, std::chrono::milliseconds now, Effects& effects);
  /// Withdraws what the node provides: it has another name now.
  void node_renamed(NodeIndex node_index, std::chrono::milliseconds now, Effects& effects);
  /// The node goes on under another index, with what it declared.
  void node_renumbered(NodeIndex node_index, NodeIndex new_index, Effects& effects);
  /// The node's session is over.
  void node_left(NodeIndex node_index, std::chrono::milliseconds now, Effects& effects);

  /// A node tells what it missed of a group in total. Nothing if it has not subscribed to it (any
  /// more).
  void note_missed(NodeIndex node, const proto::flow::Missed& missed);
  /// The same of all its subscriptions.
  [[nodiscard]] std::uint64_t missed_by(NodeIndex node) const;

  /// The node's subscriptions that had news for subscribers since that change, the latest last.
  [[nodiscard]] std::vector<const Topic*> moved_since(NodeIndex node, std::uint64_t change) const;
  [[nodiscard]] std::vector<const Topic*> provided_by(NodeIndex node) const;

  /// The terms that the node declared of that service; nullptr: it has not. Valid until: something
  /// changes here.
  [[nodiscard]] const ServiceTerms* provided(NodeIndex node, std::string_view full_name) const;
  [[nodiscard]] std::optional<SubscriberTerms> subscribed(NodeIndex node,
                                                          std::string_view full_name) const;
  [[nodiscard]] std::size_t services_of(NodeIndex node) const;
  /// Has the node a service or a subscription?
  [[nodiscard]] bool declares(NodeIndex node) const { return nodes_.contains(node); }

 private:
  struct Declared {
    Topic* topic = nullptr;
    std::uint32_t life = 0;
  };
  /// The declarations of one node; `life` counts its connections.
  struct Node {
    std::uint32_t life = 0;
    std::vector<Declared> provides;
    std::vector<Declared> subscribes;
  };
  /// Takes out of `list` what was not declared in that life.
  [[nodiscard]] static std::vector<Declared> take_undeclared(std::vector<Declared>& list,
                                                             std::uint32_t life);
  void forget_if_idle(NodeIndex node);

  Topics& topics_;
  const Limits& limits_;
  std::unordered_map<NodeIndex, Node> nodes_;
};

}  // namespace gimnet::hub
