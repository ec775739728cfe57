#include "hub/control/group_links.hpp"

#include <algorithm>
#include <string>

#include "base/log.hpp"

namespace gimnet::hub {
namespace {

namespace route = proto::route;
using std::chrono::milliseconds;

NodePlace node_place(const Place& place) { return {place.shard, place.slot, place.generation}; }

/// As JOIN can say it, which is more than any limit allows.
std::uint16_t clamped(std::uint32_t messages) {
  return static_cast<std::uint16_t>(std::min<std::uint32_t>(messages, UINT16_MAX));
}

/// The widest terms of all subscribers here. Those without terms want everything.
JoinTerms terms_of(const Topic& topic) {
  JoinTerms wish;
  if (topic.terms.size() < topic.subscribers.size()) return wish;
  bool first = true;
  for (const auto& [subscriber, asked] : topic.terms) {
    const JoinTerms terms{asked.interval_us, clamped(asked.depth), clamped(asked.window)};
    wish = std::exchange(first, false) ? terms : widest(wish, terms);
  }
  return wish;
}

JoinWish wish_of(const Topic& topic) {
  return {terms_of(topic), std::max(1u, static_cast<std::uint32_t>(topic.subscribers.size()))};
}

}  // namespace

/// The links of one group, as they become: tables first, then the shards' paces.
class GroupLinks::Change {
 public:
  Change(const Parts& parts, GroupId group, const Stream& stream)
      : parts_(parts), group_(group), stream_(stream) {}

  void remove(const Member& member) {
    gone_.push_back(node_place(member.place));
    if (member.paced) end_pace(member);
  }
  void put(Member& member, const GroupBranch& branch, bool is_new) {
    const bool was_paced = member.paced;
    const bool other_terms = is_new || member.terms != branch.terms;
    member.terms = branch.terms;
    // One that was paced stays so: what is held for it goes before what comes.
    const bool bounded = stream_.window != 0 || branch.terms.window != 0;
    member.paced = was_paced || stream_.retain || bounded || branch.terms.interval_us != 0;
    if (member.paced && !was_paced) member.once_plain = !is_new;
    links_.push_back({node_place(member.place), member.paced, member.once_plain});
    if (!member.paced) return;
    const bool from_start = branch.anew && stream_.retain && was_paced;
    if (from_start) end_pace(member);
    if (from_start || other_terms || !was_paced) begin_pace(member);
  }
  void carry_out() {
    parts_.publisher.publish_links(group_, links_, gone_);
    for (auto& [shard, command] : commands_) parts_.shards.send(shard, std::move(command));
  }

 private:
  void end_pace(const Member& member) {
    commands_.emplace_back(member.place.shard, EndPaceCommand{ref_of(member.place), group_});
  }
  void begin_pace(const Member& member) {
    PaceCommand command;
    command.session = ref_of(member.place);
    command.group = group_;
    const auto depth_most = static_cast<std::uint32_t>(parts_.limits.subscription_depth);
    // One that is on its way over the link does not wait here any more, and has not been taken.
    const std::uint32_t wish = member.terms.window;
    const std::uint32_t asked = wish > 1 ? wish - 1 : wish;
    const bool all = asked == 0 || (stream_.window != 0 && stream_.window < asked);
    command.terms = {all ? stream_.window : asked,
                     std::min<std::uint32_t>(member.terms.depth, depth_most),
                     member.terms.interval_us};
    command.retained = stream_.retain;
    command.was_plain = member.once_plain;
    commands_.emplace_back(member.place.shard, command);
  }

  const Parts& parts_;
  const GroupId group_;
  const Stream stream_;
  std::vector<TablePublisher::LinkMember> links_;
  std::vector<NodePlace> gone_;
  std::vector<std::pair<ShardIndex, ShardCommand>> commands_;
};

const GroupLinks::Neighbour* GroupLinks::find(LinkNumber link) const {
  const auto found = links_.find(link);
  return found == links_.end() ? nullptr : &found->second;
}

void GroupLinks::set_place(LinkNumber link, const Place& place, HubId neighbour) {
  links_[link] = {place, neighbour};
}

void GroupLinks::take(LinkNumber link, std::span<const std::byte> payload) {
  const auto view = proto::split_control(payload);
  if (!view) return;
  const std::uint64_t refused = trees_.refused();
  const auto read = [&](auto&& message) {
    message ? trees_.take(link, *message) : void(++malformed_);
  };
  switch (static_cast<route::RouteOperation>(view->header.operation)) {
    case route::RouteOperation::join:
      read(proto::decode<route::Join>(payload));
      break;
    case route::RouteOperation::leave:
      read(proto::decode<route::Leave>(payload));
      break;
    case route::RouteOperation::joins_end:
      read(proto::decode<route::JoinsEnd>(payload));
      break;
    case route::RouteOperation::joined:
      read(proto::decode<route::Joined>(payload));
      break;
    default:
      return;
  }
  const Neighbour* neighbour = find(link);
  if (refused == trees_.refused() || neighbour == nullptr) return;
  const std::string hub = "hub " + std::to_string(neighbour->hub.value());
  log_line(LogLevel::warning, {"joins", hub},
           hub + " joins more than " + std::to_string(GroupTrees::kJoinsMax) +
               " groups over one link; the others are not sent to it");
}

void GroupLinks::end_link(LinkNumber link) {
  trees_.end_link(link);
  links_.erase(link);
  for (const GroupId group : trees_.take_changed()) note_away(group);
}

std::vector<Sending> GroupLinks::take_sendings(milliseconds now) {
  for (const GroupId group : trees_.take_changed()) note_away(group);
  for (const GroupId group : trees_.take_recounted()) count_subscribers(group);
  return trees_.take_sendings(now);
}

void GroupLinks::note_away(GroupId group) {
  if (hub_of(group) == parts_.facts.id) return put_links(group);
  const Topic* topic = parts_.membership.topics().find_group(group);
  trees_.want(group, topic != nullptr ? std::optional{wish_of(*topic)} : std::nullopt);
  publish_away(group);
}

/// Also for those that only links want: they begin with its last message, too.
void GroupLinks::publish_away(GroupId group) {
  const auto away = away_group(group);
  parts_.publisher.publish_away(group, away, parts_.membership);
  put_links(group);
  set_keeper(group, away);
}

std::optional<TablePublisher::AwayGroup> GroupLinks::away_group(GroupId group) const {
  // Links may want groups of hubs that nobody knows: no table is made for them.
  const Neighbour* parent = find(trees_.parent(group));
  if (parent == nullptr && parts_.membership.topics().find_group(group) == nullptr)
    return std::nullopt;
  TablePublisher::AwayGroup away;
  const NameCopies* names = parts_.names.copies();
  if (const auto known = names != nullptr ? names->find_group(group) : std::nullopt) {
    away.provider = known->claim->node;
    away.retain = known->claim->service->retain;
  }
  if (parent != nullptr) {
    away.parent = parent->hub;
    away.link = node_place(parent->place);
  }
  return away;
}

/// The last message of another provider, or that came over another link, is kept no longer: JOIN
/// brings it again.
void GroupLinks::set_keeper(GroupId group, const std::optional<TablePublisher::AwayGroup>& away) {
  std::optional<Keeper> now;
  if (away && away->retain && away->link.exists()) now = {away->link.shard, away->provider};
  const auto before = keepers_.find(group);
  const bool begins = before == keepers_.end();
  if (before != keepers_.end() && now != before->second) {
    parts_.shards.send(before->second.shard, ForgetRetainedCommand{group, before->second.provider});
    keepers_.erase(before);
  }
  if (!now) return;
  if (begins) trees_.want_anew(group);
  keepers_[group] = *now;
}

GroupLinks::Stream GroupLinks::stream_of(GroupId group) const {
  using proto::ns::Delivery;
  if (hub_of(group) == parts_.facts.id) {
    const Topic* topic = parts_.membership.topics().find_group(group);
    if (topic == nullptr) return {};
    const ServiceTerms& terms = topic->service->terms;
    return {terms.retain, terms.delivery == Delivery::sync ? terms.window : 0};
  }
  const NameCopies* names = parts_.names.copies();
  const auto known = names != nullptr ? names->find_group(group) : std::nullopt;
  if (!known) return {};
  const route::ServiceClaim& terms = *known->claim->service;
  return {terms.retain, terms.delivery == Delivery::sync ? std::max(1u, terms.window) : 0};
}

void GroupLinks::put_links(GroupId group) {
  auto* branches = trees_.branches(group);
  const bool own = hub_of(group) == parts_.facts.id;
  if (branches == nullptr && !members_.contains(group)) return;
  const auto away = own ? std::nullopt : away_group(group);
  const bool published = parts_.publisher.is_published(group);
  Change change(parts_, group, stream_of(group));
  Members& members = members_[group];
  std::erase_if(members, [&](const auto& entry) {
    const bool stays = published && branches != nullptr && branches->contains(entry.first) &&
                       find(entry.first) != nullptr;
    if (!stays) change.remove(entry.second);
    return !stays;
  });
  if (published && branches != nullptr) {
    for (auto& [link, branch] : *branches) {
      const Neighbour* neighbour = find(link);
      const auto known = members.find(link);
      const bool back = away && neighbour != nullptr && neighbour->hub == away->parent;
      if (neighbour == nullptr || back) {
        if (known != members.end()) change.remove(known->second);
        members.erase(link);
        continue;
      }
      Member& member = known != members.end() ? known->second : members[link];
      const bool is_new = known == members.end();
      member.place = neighbour->place;
      change.put(member, branch, is_new);
      branch.anew = false;
    }
  }
  change.carry_out();
  if (members.empty()) members_.erase(group);
  count_subscribers(group);
}

void GroupLinks::count_subscribers(GroupId group) {
  if (hub_of(group) != parts_.facts.id) return;
  std::uint32_t afar = 0;
  const auto members = members_.find(group);
  const auto* const branches = trees_.branches(group);
  if (members != members_.end() && branches != nullptr) {
    for (const auto& [link, branch] : *branches) {
      if (members->second.contains(link)) afar = add_subscribers(afar, branch.subscribers);
    }
  }
  parts_.membership.topics().set_afar(group_index_of(group), afar, effects_);
}

bool GroupLinks::hold(GroupId group, ShardIndex shard, SendControlCommand& answer,
                      milliseconds now) {
  if (trees_.is_joined(group) || trees_.parent(group) == LinkNumber{}) return false;
  waiting_.push_back({group, shard, std::move(answer), now + kAnswerWait});
  return true;
}

void GroupLinks::release(milliseconds now) {
  std::erase_if(waiting_, [&](Waiting& each) {
    if (each.until > now && !trees_.is_joined(each.group)) return false;
    parts_.shards.send(each.shard, std::move(each.answer));
    return true;
  });
}

std::optional<milliseconds> GroupLinks::next_due() const {
  const std::optional<milliseconds> counts = trees_.next_due();
  if (waiting_.empty()) return counts;
  return std::min(counts.value_or(milliseconds::max()), waiting_.front().until);
}

}  // namespace gimnet::hub
