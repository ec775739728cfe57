#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "base/result.hpp"
#include "hub/control/state/due_list.hpp"
#include "hub/control/state/effects.hpp"
#include "hub/control/state/index_pool.hpp"
#include "hub/limits.hpp"
#include "proto/control/control_message.hpp"

namespace gimnet::hub {

/// The terms of a service, as its provider gives them.
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

/// A group id stands for a full name with its terms, whoever provides it.
struct LocalService {
  GroupIndex group;
  NodeIndex provider;  ///< kNobody: nobody at the moment
  ServiceTerms terms;  ///< the latest provider's
  /// It accepts, and its provider has lost its connection and not advertised it again since.
  bool provider_away = false;
};
inline constexpr NodeIndex kNobody{};

/// A service of another hub that gives data, as far as its subscribers here are concerned.
struct AwayService {
  GroupId group;
  NodeId provider;
  std::uint32_t window = 0;  ///< n of sync(n); 0: another delivery
  bool retain = false;
  friend bool operator==(const AwayService&, const AwayService&) = default;
};

/// A full name that somebody provides, or waits for, or that still has a group id.
struct Topic {
  std::string_view full_name;
  std::optional<LocalService> service;                   ///< nothing: no group id here
  std::optional<AwayService> away;                       ///< only without `service`
  std::vector<NodeIndex> subscribers;                    ///< ascending
  std::unordered_map<NodeIndex, SubscriberTerms> terms;  ///< of those that asked for something
  /// Subscribers that changed their terms in this group: that got everything and are paced now; and
  /// that asked for a pace and do not any more. Those stay paced, without bounds: what is held for
  /// them goes before what comes.
  std::unordered_set<NodeIndex> once_plain;
  std::unordered_set<NodeIndex> once_paced;
  std::uint64_t change = 0;  ///< number of the last one that subscribers were told; 0: none
  std::uint64_t orphan = 0;  ///< since when, in order, nobody provides the group; 0: somebody does
  std::uint64_t unused = 0;  ///< since when nobody has subscribed either; 0: it is used
  std::uint32_t afar = 0;    ///< subscribers at other hubs, as those say
  /// Messages that subscribers said they missed, of those that missed some.
  std::unordered_map<NodeIndex, std::uint64_t> missed;

  [[nodiscard]] bool provided() const { return service && service->provider != kNobody; }
  /// Whose messages subscribers get, from this hub or another one; nothing: no group.
  [[nodiscard]] std::optional<GroupId> group(HubId own) const;
  [[nodiscard]] bool retains() const {
    return service ? service->terms.retain : away && away->retain;
  }
  /// Here and at other hubs, at most 2^32-1.
  [[nodiscard]] std::uint32_t subscriber_count() const {
    return static_cast<std::uint32_t>(
        std::min<std::uint64_t>(subscribers.size() + std::uint64_t{afar}, UINT32_MAX));
  }
  /// The pace that the shards keep for that subscriber; nothing if it gets everything.
  [[nodiscard]] std::optional<SubscriberTerms> pace_of(NodeIndex subscriber) const;
  /// In force; 0: the subscriber's messages are not counted.
  [[nodiscard]] std::uint32_t window_of(NodeIndex subscriber) const {
    const std::optional<SubscriberTerms> pace = pace_of(subscriber);
    return pace ? pace->window : 0;
  }
};

/// Full names with their groups, providers and subscribers. A group id stands for a name with its
/// terms, and goes from one provider to the next; a group that nobody used for a grace time is
/// given back. The effects tell everybody that follows a name. Who may declare something is decided
/// by Services. Thread safety: none. Ownership: a Topic& is good while it has a group or a
/// subscriber. Limits: group ids, of which those go first that nobody provides.
class Topics {
 public:
  /// In the order of names, which no choice of names can make slow, and which finds at once all
  /// that begin alike.
  using ByName = std::map<std::string, Topic, std::less<>>;

  Topics(HubId hub, const Limits& limits, const IndexRange& groups = {});

  /// The name keeps its group, whoever provides it, if no more than the metadata differs from what
  /// the group stands for. Else it gets a new one, which its subscribers are told before it is
  /// published. Errors: limit. REQUIRES: no other node provides it.
  [[nodiscard]] Result<Topic*, proto::Refusal> provide(std::string_view full_name,
                                                       NodeIndex provider,
                                                       const ServiceTerms& terms,
                                                       std::chrono::milliseconds now,
                                                       Effects& effects);
  /// REQUIRES: somebody provides it.
  void end_provision(Topic& topic, std::chrono::milliseconds now, Effects& effects);
  /// The provider of a service that accepts is away, or is there: its subscribers and the other
  /// hubs are told if that is new. REQUIRES: somebody provides it.
  void set_provider_away(Topic& topic, bool away, Effects& effects);
  /// The provider goes on under that index.
  void renumber_provider(Topic& topic, NodeIndex provider, Effects& effects);

  /// The topic, with or without a service yet. `away`: who has it, if nobody here. REQUIRES: the
  /// node has not subscribed to it.
  [[nodiscard]] Topic& add_subscriber(std::string_view full_name, NodeIndex subscriber,
                                      const SubscriberTerms& terms,
                                      const std::optional<AwayService>& away, Effects& effects);
  /// REQUIRES, as the next ones: the node has subscribed to it.
  void change_terms(Topic& topic, NodeIndex subscriber, const SubscriberTerms& terms,
                    Effects& effects);
  void remove_subscriber(Topic& topic, NodeIndex subscriber, std::chrono::milliseconds now,
                         Effects& effects);
  void renumber_subscriber(Topic& topic, NodeIndex former, NodeIndex subscriber, Effects& effects);

  /// Gives back the groups that nobody used for a grace time.
  void tick(std::chrono::milliseconds now, Effects& effects);
  /// When tick() has something to do; nothing while nothing runs out.
  [[nodiscard]] std::optional<std::chrono::milliseconds> next_deadline() const;
  void put_off(std::chrono::milliseconds time, std::chrono::milliseconds latest) {
    unused_.put_off(time, latest);
  }

  /// Another hub has a service of that name, another one than before, or none any more: those here
  /// that subscribed to it are told, and get its messages. `away`: if it gives data.
  void note_moved(std::string_view full_name, const std::optional<AwayService>& away,
                  std::chrono::milliseconds now, Effects& effects);
  /// Notes the number of subscribers at other hubs of a group of this hub.
  void set_afar(GroupIndex group, std::uint32_t subscribers, Effects& effects);

  /// Grows with each ServiceChanged.
  [[nodiscard]] std::uint64_t changes() const { return changes_; }
  /// nullptr: nobody provides it, nor waits for it.
  [[nodiscard]] Topic* find(std::string_view full_name);
  [[nodiscard]] const Topic* find(std::string_view full_name) const;
  /// nullptr: no such group.
  [[nodiscard]] Topic* find_group(GroupIndex group);
  [[nodiscard]] const Topic* find_group(GroupIndex group) const;
  /// The same of this hub or another one, which somebody here has subscribed to.
  [[nodiscard]] const Topic* find_group(GroupId group) const;
  /// Topics with a group, by ascending group index; some are provided by nobody.
  [[nodiscard]] const std::map<GroupIndex, Topic*>& groups() const { return groups_; }
  /// Services that somebody provides.
  [[nodiscard]] std::size_t provided() const { return groups_.size() - orphans_.size(); }
  [[nodiscard]] const ByName& by_name() const { return by_name_; }
  [[nodiscard]] HubId hub() const { return hub_; }
  [[nodiscard]] IndexPool& group_indices() { return group_indices_; }
  [[nodiscard]] const IndexPool& group_indices() const { return group_indices_; }

 private:
  /// A group that nobody uses. Void once it is used or gone.
  struct Unused {
    std::chrono::milliseconds until;
    GroupIndex group;
    std::uint64_t since = 0;  ///< Topic::unused
  };

  Topic& topic(std::string_view full_name);
  void forget_if_unused(Topic& topic);
  /// A group that no other name has; the oldest ones that nobody provides make room.
  [[nodiscard]] std::optional<GroupIndex> take_group(std::chrono::milliseconds now,
                                                     Effects& effects);
  void enter_group(Topic& topic, const LocalService& service, std::chrono::milliseconds now,
                   Effects& effects);
  void begin_away(Topic& topic, const AwayService& away, Effects& effects);
  void end_away(Topic& topic, Effects& effects);
  void take_over(Topic& topic, NodeIndex provider, const ServiceTerms& terms, Effects& effects);
  void leave_group(Topic& topic, std::chrono::milliseconds now, Effects& effects);
  void give_back(Topic& topic, std::chrono::milliseconds now, Effects& effects);
  void note_use(Topic& topic);
  void note_if_unused(Topic& topic, std::chrono::milliseconds now);
  [[nodiscard]] bool is_void(const Unused& note) const;
  void begin_pace(const Topic& topic, NodeIndex subscriber, Effects& effects) const;
  [[nodiscard]] static ServiceNoted service_noted(proto::ns::ChangeKind kind, const Topic& topic);
  void tell_subscribers(Topic& topic, Effects& effects, bool joins = false);

  const HubId hub_;
  const Limits& limits_;
  IndexPool group_indices_;
  ByName by_name_;
  std::map<GroupIndex, Topic*> groups_;
  std::map<GroupId, Topic*> away_;           ///< of other hubs
  std::map<std::uint64_t, Topic*> orphans_;  ///< by Topic::orphan: the oldest first
  DueList<Unused> unused_;
  std::uint64_t changes_ = 0;
  std::uint64_t orphaned_ = 0;  ///< numbers the orphans, and the times at which groups fell unused
};

}  // namespace gimnet::hub
