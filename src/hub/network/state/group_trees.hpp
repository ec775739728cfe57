#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "hub/network/state/network_state.hpp"
#include "proto/control/route_groups.hpp"

namespace gimnet::hub {

using proto::route::JoinTerms;

/// Terms that both are content with.
[[nodiscard]] JoinTerms widest(const JoinTerms& a, const JoinTerms& b);

/// The wish of all subscribers of a hub to a group, or of those behind it, too.
struct JoinWish {
  JoinTerms terms;
  std::uint32_t subscribers = 1;
  friend bool operator==(const JoinWish&, const JoinWish&) = default;
};

/// Numbers of subscribers together, or the largest number there is.
[[nodiscard]] constexpr std::uint32_t add_subscribers(std::uint32_t a, std::uint32_t b) {
  return a > UINT32_MAX - b ? UINT32_MAX : a + b;
}

/// A link behind which a group has subscribers.
struct GroupBranch {
  JoinTerms terms;
  std::uint32_t subscribers = 1;  ///< as the hub there says
  bool anew = false;              ///< it is to begin with the last message; its owner clears it
  bool stale = false;             ///< not named again on the present connection
  bool told = false;              ///< its JOIN was answered
};

/// Which neighbours want which groups, and of which neighbour this hub wants them. A group's
/// messages come from the *parent*: the next hop towards the hub that has the group. A hub joins
/// there while it has subscribers, or neighbours that joined here. It says the widest terms of all
/// of them, and again when they change. It also says how many subscribers there are, and tells
/// changed numbers each kCountPause: a thousand subscribers that come one by one are few messages.
/// Pure state: what comes over links is an argument. Thread safety: none. Limits: kJoinsMax groups
/// of one link.
class GroupTrees {
 public:
  static constexpr std::size_t kJoinsMax = 65'536;
  static constexpr std::chrono::milliseconds kCountPause{100};

  explicit GroupTrees(HubId self) : self_(self) {}

  // Messages of links

  /// A connection begins. All joins are said to it, then JOINS_END; what the other side had joined
  /// holds until its JOINS_END.
  void begin_connection(LinkNumber link);
  void take(LinkNumber link, const proto::route::Join& join);
  void take(LinkNumber link, const proto::route::Leave& leave);
  void take(LinkNumber link, const proto::route::JoinsEnd& end);
  void take(LinkNumber link, const proto::route::Joined& joined);
  void end_link(LinkNumber link);

  /// The wish of this hub's subscribers to a group; nothing: there are none. REQUIRES: a group
  /// of another hub.
  void want(GroupId group, std::optional<JoinWish> own);
  /// The last message of the group, which passed by when nobody knew that it is to be kept, is
  /// asked for again.
  void want_anew(GroupId group);
  /// By hub id, as in NetworkMap.
  void set_next_hops(const std::array<LinkNumber, NetworkMap::kHubIds>& next_hops);

  /// Null: nobody wants the group.
  [[nodiscard]] std::map<LinkNumber, GroupBranch>* branches(GroupId group);
  [[nodiscard]] const std::map<LinkNumber, GroupBranch>* branches(GroupId group) const;
  /// 0: the group is this hub's own, or nobody wants it, or there is no way to its hub.
  [[nodiscard]] LinkNumber parent(GroupId group) const;
  /// Messages come, as far as this hub knows. REQUIRES: a group of another hub.
  [[nodiscard]] bool is_joined(GroupId group) const;
  [[nodiscard]] std::size_t size() const { return trees_.size(); }
  /// JOINs that were not taken, because their link had too many.
  [[nodiscard]] std::uint64_t refused() const { return refused_; }

  /// Groups of which branches or the parent changed since the last call.
  [[nodiscard]] std::set<GroupId> take_changed() { return std::exchange(changed_, {}); }
  /// Other groups, of which branches have another number of subscribers since the last call.
  [[nodiscard]] std::set<GroupId> take_recounted() { return std::exchange(recounted_, {}); }
  /// Messages that follow. To be called after those of take_changed() were published.
  [[nodiscard]] std::vector<Sending> take_sendings(std::chrono::milliseconds now);
  /// When there will be some without anything else happening.
  [[nodiscard]] std::optional<std::chrono::milliseconds> next_due() const { return counts_due_; }

 private:
  struct Tree {
    std::optional<JoinWish> own;
    std::map<LinkNumber, GroupBranch> branches;
    LinkNumber said_to;  ///< whom JOIN was said to; 0: nobody
    JoinWish said;
    bool answered = false;  ///< by that neighbour
    bool anew = false;      ///< it is to be asked for the last message again
  };
  using Trees = std::map<GroupId, Tree>;
  class Batches;

  void note(GroupId group);
  /// Of those on branches only if no branch is the way to the group's hub.
  [[nodiscard]] std::optional<JoinWish> wish(const Tree& tree, LinkNumber parent) const;
  void remove_branch(Trees::iterator tree, LinkNumber link);
  void say(GroupId group, Tree& tree, Batches& batches);
  void say_counts(Batches& batches);

  const HubId self_;
  Trees trees_;
  std::array<LinkNumber, NetworkMap::kHubIds> next_hops_{};
  std::map<LinkNumber, std::size_t> joins_;  ///< groups by link
  std::set<LinkNumber> begun_;               ///< connections to which JOINS_END is to be said
  std::set<GroupId> changed_;
  std::set<GroupId> recounted_;
  std::set<GroupId> unsaid_;     ///< of which something may have to be said
  std::set<GroupId> uncounted_;  ///< of which the parent was told another number
  std::optional<std::chrono::milliseconds> counts_due_;  ///< while uncounted_ has some
  std::uint64_t refused_ = 0;
};

}  // namespace gimnet::hub
