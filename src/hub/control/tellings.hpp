#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "hub/control/hub_facts.hpp"
#include "hub/control/network_names.hpp"
#include "hub/control/shard_proxy.hpp"
#include "hub/control/state/effects.hpp"
#include "hub/control/state/membership.hpp"
#include "hub/control/state/watches.hpp"
#include "hub/control/table_publisher.hpp"

namespace gimnet::hub {

/// Tells nodes of services, in pieces: of each that moved, its subscribers; and a node that an
/// event was dropped for, all that it may have missed, while what it watches begins again. Each is
/// told the state of that moment. Thread safety: the conductor's thread only. Lifetime: its parts
/// outlive it. Limits: two entries for each service, and one for each node.
class Tellings {
 public:
  struct Parts {
    const HubFacts& facts;
    ShardProxy& shards;
    const Membership& membership;
    Watches& watches;
    TablePublisher& publisher;
    const NetworkNames* names = nullptr;  ///< or none: a hub alone
  };
  explicit Tellings(const Parts& parts) : parts_(parts) {}

  /// Its subscribers are to be told. A round that is under way is ended first: a service that moves
  /// again and again keeps nobody from being told.
  void put(const ServiceChanged& moved);
  /// Events for that connection of the node were dropped, and it has taken all others.
  void put(NodeIndex node, std::uint32_t attachment);
  /// Tells so many subscribers at most, and counts `most` down; nodes that missed events once no
  /// service waits.
  void work_off(std::uint64_t& most);
  [[nodiscard]] bool empty() const { return !round_ && waiting_.empty() && missed_.empty(); }

  /// Adds what the node has to be told ahead of all else, since it came back: the services that
  /// changed since that change, the latest last.
  void add_moved(const Session& session, std::uint64_t change,
                 std::vector<std::byte>& frames) const;
  /// After the node was told so: it is a member of their groups, and paced, although its turn has
  /// not come or its shard dropped the event.
  void join_moved(const Session& session, std::uint64_t change) const;
  /// Has the subscriber's shard pace what it gets. `with_event`: only if it did not drop events.
  void begin_pace(const Topic& topic, const Session& subscriber, bool with_event) const;
  [[nodiscard]] proto::Payload subscribers_event(const Topic& topic) const;

 private:
  /// A service whose subscribers are being told.
  struct Round {
    std::string full_name;
    bool joins = false;
    NodeIndex last;  ///< that was told
  };
  struct Missed {
    NodeIndex node;
    std::uint32_t attachment = 0;
  };
  void tell(const Topic& topic, std::span<const NodeIndex> subscribers) const;
  void join(const Topic& topic, std::span<const NodeIndex> subscribers, bool with_event) const;
  [[nodiscard]] std::size_t tell_again(const Missed& missed) const;
  [[nodiscard]] std::vector<std::byte> moved_frame(const Topic& topic, NodeId to,
                                                   std::uint32_t window) const;
  [[nodiscard]] const Session* find(NodeIndex node) const {
    return parts_.membership.sessions().find(node);
  }

  const Parts parts_;
  std::optional<Round> round_;
  std::deque<std::string> order_;                  ///< of waiting_. Limit: as that
  std::unordered_map<std::string, bool> waiting_;  ///< do they join? Limit: the services
  std::deque<Missed> missed_;                      ///< Limit: the nodes
};

}  // namespace gimnet::hub
