#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "hub/control/hub_facts.hpp"
#include "hub/control/network_names.hpp"
#include "hub/control/shard_proxy.hpp"
#include "hub/control/state/effects.hpp"
#include "hub/control/state/membership.hpp"
#include "hub/control/table_publisher.hpp"
#include "hub/network/state/group_trees.hpp"

namespace gimnet::hub {

/// Carries groups over links: has the shards send this hub's groups to the links that joined them,
/// and joins the groups of other hubs that nodes here have subscribed to, or links joined here.
/// Thread safety: the conductor's thread only. Lifetime: its parts outlive it. Limits: those of
/// GroupTrees; answers wait for kAnswerWait at most.
class GroupLinks {
 public:
  /// The answer to a subscription waits so long for the group's messages to come.
  static constexpr std::chrono::milliseconds kAnswerWait{1'000};

  struct Parts {
    const HubFacts& facts;
    const Limits& limits;
    ShardProxy& shards;
    Membership& membership;
    TablePublisher& publisher;
    const NetworkNames& names;
  };
  explicit GroupLinks(const Parts& parts) : parts_(parts), trees_(parts.facts.id) {}

  // For the links

  /// A shard has the link there.
  void set_place(LinkNumber link, const Place& place, HubId neighbour);
  void begin_connection(LinkNumber link) { trees_.begin_connection(link); }
  /// The payload of a ROUTE frame; those that are about something else are not looked at.
  void take(LinkNumber link, std::span<const std::byte> payload);
  /// To be called before the shard forgets the link.
  void end_link(LinkNumber link);
  void set_next_hops(const NetworkMap& map) { trees_.set_next_hops(map.next_hops()); }
  /// Publishes what changed, and says what follows from it.
  [[nodiscard]] std::vector<Sending> take_sendings(std::chrono::milliseconds now);

  // For the rest of the conductor

  /// Something changed of a group of another hub, or of what is wanted of it here.
  void note_away(GroupId group);
  /// A group of this hub was published, or is no more.
  void note_own(GroupIndex index) { put_links(make_id(parts_.facts.id, index)); }
  /// Effects of links on the services of this hub.
  [[nodiscard]] Effects take_effects() { return std::exchange(effects_, {}); }

  /// Keeps the answer to a subscription until messages of the group come. False: they do already,
  /// or there is no way to its hub, and the answer is as it was. To be called after
  /// take_sendings().
  [[nodiscard]] bool hold(GroupId group, ShardIndex shard, SendControlCommand& answer,
                          std::chrono::milliseconds now);
  /// Sends answers that need not wait any more.
  void release(std::chrono::milliseconds now);
  [[nodiscard]] std::optional<std::chrono::milliseconds> next_due() const;

  /// ROUTE messages that were not what they should be, and JOINs beyond the limit of a link.
  [[nodiscard]] std::uint64_t malformed() const { return malformed_; }
  [[nodiscard]] std::uint64_t refused() const { return trees_.refused(); }

 private:
  struct Neighbour {
    Place place;
    HubId hub;
  };
  /// A link as the shards know it of one group.
  struct Member {
    Place place;
    JoinTerms terms;
    bool paced = false;
    bool once_plain = false;  ///< it got everything before it was paced
  };
  using Members = std::map<LinkNumber, Member>;
  /// The shard that keeps the last message of a group of another hub.
  struct Keeper {
    ShardIndex shard;
    NodeId provider;
    friend bool operator==(const Keeper&, const Keeper&) = default;
  };
  /// A service as its links are held to it.
  struct Stream {
    bool retain = false;
    std::uint32_t window = 0;  ///< messages that wait for one link at most; 0: any number
  };
  struct Waiting {
    GroupId group;
    ShardIndex shard;
    SendControlCommand answer;
    std::chrono::milliseconds until;
  };
  class Change;

  void publish_away(GroupId group);
  [[nodiscard]] std::optional<TablePublisher::AwayGroup> away_group(GroupId group) const;
  void set_keeper(GroupId group, const std::optional<TablePublisher::AwayGroup>& away);
  [[nodiscard]] Stream stream_of(GroupId group) const;
  void put_links(GroupId group);
  /// Has the provider of a group of this hub told of the subscribers behind its links.
  void count_subscribers(GroupId group);
  [[nodiscard]] const Neighbour* find(LinkNumber link) const;

  const Parts parts_;
  GroupTrees trees_;
  std::map<LinkNumber, Neighbour> links_;
  std::map<GroupId, Members> members_;
  std::map<GroupId, Keeper> keepers_;
  std::deque<Waiting> waiting_;  ///< Limit: the unanswered requests of all nodes
  Effects effects_;
  std::uint64_t malformed_ = 0;
};

}  // namespace gimnet::hub
