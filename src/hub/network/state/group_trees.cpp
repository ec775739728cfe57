#include "hub/network/state/group_trees.hpp"

#include <algorithm>
#include <memory>

#include "base/check.hpp"

namespace gimnet::hub {

namespace route = proto::route;

JoinTerms widest(const JoinTerms& a, const JoinTerms& b) {
  const bool unbound = a.window == 0 || b.window == 0;
  return {std::min(a.interval_us, b.interval_us), std::max(a.depth, b.depth),
          unbound ? std::uint16_t{0} : std::max(a.window, b.window)};
}

/// Messages for each link, with several groups in each.
class GroupTrees::Batches {
 public:
  void join(LinkNumber link, const route::Join::Entry& entry, bool anew) {
    add(anew ? anew_[link] : changed_[link], entry);
  }
  void leave(LinkNumber link, GroupId group) { add(left_[link], group); }
  void joined(LinkNumber link, GroupId group) { add(joined_[link], group); }

  [[nodiscard]] std::vector<Sending> encode(const std::set<LinkNumber>& begun) const {
    std::vector<Sending> sendings;
    const auto put = [&](LinkNumber link, const auto& message) {
      sendings.push_back({link, std::make_shared<const proto::Payload>(proto::encode(message))});
    };
    for (const auto& [link, lists] : left_) {
      for (const auto& list : lists) put(link, route::Leave{list});
    }
    for (const auto& [link, lists] : anew_) {
      for (const auto& list : lists) put(link, route::Join{list, true});
    }
    for (const auto& [link, lists] : changed_) {
      for (const auto& list : lists) put(link, route::Join{list, false});
    }
    for (const LinkNumber link : begun) put(link, route::JoinsEnd{});
    for (const auto& [link, lists] : joined_) {
      for (const auto& list : lists) put(link, route::Joined{list});
    }
    return sendings;
  }

 private:
  template <class Entry>
  using ByLink = std::map<LinkNumber, std::vector<std::vector<Entry>>>;

  template <class Entry>
  static void add(std::vector<std::vector<Entry>>& lists, const Entry& entry) {
    if (lists.empty() || lists.back().size() == route::kGroupsMax) lists.emplace_back();
    lists.back().push_back(entry);
  }

  ByLink<GroupId> left_;
  ByLink<route::Join::Entry> anew_;
  ByLink<route::Join::Entry> changed_;
  ByLink<GroupId> joined_;
};

void GroupTrees::note(GroupId group) {
  changed_.insert(group);
  unsaid_.insert(group);
}

void GroupTrees::begin_connection(LinkNumber link) {
  begun_.insert(link);
  for (auto& [group, tree] : trees_) {
    if (const auto found = tree.branches.find(link); found != tree.branches.end())
      found->second.stale = true;
    if (tree.said_to != link) continue;
    tree.said_to = {};
    tree.answered = false;
    unsaid_.insert(group);
  }
}

void GroupTrees::take(LinkNumber link, const route::Join& join) {
  std::size_t& joins = joins_[link];
  for (const route::Join::Entry& entry : join.groups) {
    auto tree = trees_.find(entry.group);
    const bool known = tree != trees_.end() && tree->second.branches.contains(link);
    if (!known && joins == kJoinsMax) {
      ++refused_;
      continue;
    }
    if (tree == trees_.end()) tree = trees_.try_emplace(entry.group).first;
    GroupBranch& branch = tree->second.branches[link];
    if (!known) ++joins;
    const bool recounts = known && !branch.stale && !join.anew && branch.terms == entry.terms;
    branch.terms = entry.terms;
    branch.subscribers = entry.subscribers;
    branch.anew = branch.anew || join.anew;
    branch.stale = branch.told = false;
    unsaid_.insert(entry.group);
    (recounts ? recounted_ : changed_).insert(entry.group);
  }
}

void GroupTrees::take(LinkNumber link, const route::Leave& leave) {
  for (const GroupId group : leave.groups) {
    if (const auto tree = trees_.find(group); tree != trees_.end()) remove_branch(tree, link);
  }
}

void GroupTrees::take(LinkNumber link, const route::JoinsEnd&) {
  for (auto tree = trees_.begin(); tree != trees_.end();) {
    const auto at = tree++;
    const auto found = at->second.branches.find(link);
    if (found != at->second.branches.end() && found->second.stale) remove_branch(at, link);
  }
}

void GroupTrees::take(LinkNumber link, const route::Joined& joined) {
  for (const GroupId group : joined.groups) {
    const auto tree = trees_.find(group);
    if (tree == trees_.end() || tree->second.said_to != link) continue;
    tree->second.answered = true;
    unsaid_.insert(group);
  }
}

void GroupTrees::end_link(LinkNumber link) {
  begun_.erase(link);
  for (auto tree = trees_.begin(); tree != trees_.end();) {
    const auto at = tree++;
    if (at->second.said_to == link) {
      at->second.said_to = {};
      at->second.answered = false;
      note(at->first);
    }
    remove_branch(at, link);
  }
  std::ranges::replace(next_hops_, link, LinkNumber{});
  joins_.erase(link);
}

/// A tree that nobody wants goes when that was said.
void GroupTrees::remove_branch(Trees::iterator tree, LinkNumber link) {
  if (tree->second.branches.erase(link) == 0) return;
  --joins_.at(link);
  note(tree->first);
}

void GroupTrees::want(GroupId group, std::optional<JoinWish> own) {
  GIMNET_CHECK(hub_of(group) != self_);
  const auto tree = trees_.find(group);
  if (tree == trees_.end() && !own) return;
  Tree& wanted = tree != trees_.end() ? tree->second : trees_[group];
  if (wanted.own == own) return;
  const bool recounts = wanted.own && own && wanted.own->terms == own->terms;
  wanted.own = own;
  if (!recounts) changed_.insert(group);
  unsaid_.insert(group);
}

void GroupTrees::want_anew(GroupId group) {
  const auto tree = trees_.find(group);
  if (tree == trees_.end() || tree->second.said_to == LinkNumber{}) return;
  tree->second.anew = true;
  unsaid_.insert(group);
}

void GroupTrees::set_next_hops(const std::array<LinkNumber, NetworkMap::kHubIds>& next_hops) {
  const auto before = std::exchange(next_hops_, next_hops);
  for (const auto& [group, tree] : trees_) {
    const std::size_t hub = hub_of(group).value();
    if (before[hub] != next_hops_[hub]) note(group);
  }
}

std::map<LinkNumber, GroupBranch>* GroupTrees::branches(GroupId group) {
  const auto tree = trees_.find(group);
  return tree == trees_.end() ? nullptr : &tree->second.branches;
}

const std::map<LinkNumber, GroupBranch>* GroupTrees::branches(GroupId group) const {
  const auto tree = trees_.find(group);
  return tree == trees_.end() ? nullptr : &tree->second.branches;
}

LinkNumber GroupTrees::parent(GroupId group) const {
  const auto tree = trees_.find(group);
  if (hub_of(group) == self_ || tree == trees_.end()) return {};
  const LinkNumber next_hop = next_hops_[hub_of(group).value()];
  return wish(tree->second, next_hop) ? next_hop : LinkNumber{};
}

bool GroupTrees::is_joined(GroupId group) const {
  const auto tree = trees_.find(group);
  return tree != trees_.end() && tree->second.said_to != LinkNumber{} && tree->second.answered;
}

std::optional<JoinWish> GroupTrees::wish(const Tree& tree, LinkNumber parent) const {
  std::optional<JoinWish> all = tree.own;
  for (const auto& [link, branch] : tree.branches) {
    if (link == parent) continue;
    const JoinWish behind{branch.terms, branch.subscribers};
    all = all ? JoinWish{widest(all->terms, behind.terms),
                         add_subscribers(all->subscribers, behind.subscribers)}
              : behind;
  }
  return all;
}

std::vector<Sending> GroupTrees::take_sendings(std::chrono::milliseconds now) {
  Batches batches;
  for (const GroupId group : std::exchange(unsaid_, {})) {
    const auto tree = trees_.find(group);
    if (tree == trees_.end()) continue;
    say(group, tree->second, batches);
    if (!tree->second.own && tree->second.branches.empty()) trees_.erase(tree);
  }
  if (counts_due_ && now >= *counts_due_) say_counts(batches);
  if (!uncounted_.empty() && !counts_due_) counts_due_ = now + kCountPause;
  return batches.encode(std::exchange(begun_, {}));
}

void GroupTrees::say(GroupId group, Tree& tree, Batches& batches) {
  const bool own = hub_of(group) == self_;
  if (!own) {
    const LinkNumber to = parent(group);
    const bool moved = to != tree.said_to;
    if (moved && tree.said_to != LinkNumber{}) batches.leave(tree.said_to, group);
    if (to != LinkNumber{}) {
      const JoinWish wanted = *wish(tree, to);
      const bool anew = std::exchange(tree.anew, false) || moved;
      if (anew || wanted.terms != tree.said.terms) {
        batches.join(to, {group, wanted.terms, wanted.subscribers}, anew);
        tree.said = wanted;
      } else if (wanted != tree.said) {
        uncounted_.insert(group);
      }
    }
    if (moved) tree.answered = false;
    tree.said_to = to;
  }
  if (!own && !tree.answered) return;
  for (auto& [link, branch] : tree.branches) {
    if (!std::exchange(branch.told, true)) batches.joined(link, group);
  }
}

/// Others were told with new terms meanwhile, or are wanted no more.
void GroupTrees::say_counts(Batches& batches) {
  counts_due_.reset();
  for (const GroupId group : std::exchange(uncounted_, {})) {
    const auto tree = trees_.find(group);
    if (tree == trees_.end() || tree->second.said_to == LinkNumber{}) continue;
    const std::optional<JoinWish> wanted = wish(tree->second, tree->second.said_to);
    if (!wanted || wanted == tree->second.said) continue;
    batches.join(tree->second.said_to, {group, wanted->terms, wanted->subscribers}, false);
    tree->second.said = *wanted;
  }
}

}  // namespace gimnet::hub
