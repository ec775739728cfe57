#include "hub/data/route/router.hpp"

#include <algorithm>
#include <bit>

#include "proto/frame/frame_parser.hpp"

namespace gimnet::hub {
namespace {

/// From so many recipients on a shard on, a reference each beats a copy each, however small the
/// frames are (bench/hub/data/fanout/fanout_bench.cpp).
constexpr std::size_t kReferenceRecipients = 4;

}  // namespace

void Router::drop(const Run& run, proto::DropReason reason) {
  fanout_.context().drops.drop(run.bytes, run.frames, reason);
}

/// A frame that was counted once has `outcomes` outcomes now.
void Router::settle(const Run& run, std::uint32_t outcomes) {
  if (outcomes == 0) {
    drop(run, proto::DropReason::no_subscriber);
  } else {
    fanout_.context().tally.copies += std::uint64_t{outcomes - 1} * run.frames;
  }
}

NodePlace Router::place_of(NodeId node) const {
  return hub_of(node) == hub_ ? nodes_.find(index_of(node)) : routes_.find(hub_of(node)).link;
}

void Router::dispatch(const Run& run, const proto::FrameHeader& header, Arrival arrival) {
  fanout_.context().owner.check_here();
  switch (header.kind) {
    case proto::Kind::group:
      return to_group(run, header, arrival);
    case proto::Kind::list:
      return arrival.handed_over() ? to_listed_here(run, header) : to_list(run, header);
    case proto::Kind::broadcast:
      return to_everybody(run, header, arrival);
    case proto::Kind::service:
      return to_provider(run, header, arrival);
    default:
      return to_node(run, header, NodeId{header.dst}, arrival);
  }
}

Run Router::route_handed_over(const Run& frames, std::uint32_t length_max,
                              std::uint64_t deliveries_end) {
  fanout_.context().owner.check_here();
  const std::byte* next = frames.bytes;
  const std::byte* const end = frames.bytes + frames.size;
  std::uint32_t left = frames.frames;
  begin_bytes(NodeId{});
  while (true) {
    const proto::RunView repeats = append_repeats(next, end);
    next += repeats.size;
    left -= repeats.frames;
    fanout_.context().tally.queued -= repeats.frames;
    if (next == end) return Run{};
    if (deliveries_ >= deliveries_end) {
      return Run{frames.buffer.share(), next, static_cast<std::uint32_t>(end - next), left};
    }
    // A LIST frame for this shard has two headers.
    const proto::NextRun found = proto::next_run(next, end, length_max + proto::kHeaderSize);
    GIMNET_CHECK(found.found == proto::Found::run);  // the sending shard parsed them
    next += found.run.size;
    left -= found.run.frames;
    fanout_.context().tally.queued -= found.run.frames;
    route(frames.buffer, found.run, Origin::another_shard);
  }
}

inline Recipient* Router::find_here(const Run& run, const NodePlace& place, Arrival arrival) {
  // A frame that was handed over here and would have to go on is for a node that left meanwhile.
  const bool here = place.shard == fanout_.self();
  if (!here && !arrival.handed_over()) {
    fanout_.hand_over(place.shard, run);
    return nullptr;
  }
  Recipient* recipient = here ? fanout_.recipients().find(place.slot, place.generation) : nullptr;
  if (recipient == nullptr) drop(run, proto::DropReason::no_such_node);
  return recipient;
}

void Router::to_node(const Run& run, const proto::FrameHeader& header, NodeId node,
                     Arrival arrival) {
  if (hub_of(node) != hub_) return to_hub(run, header, hub_of(node), arrival);
  const NodePlace place = nodes_.find(index_of(node));
  if (!place.exists()) return drop(run, why_absent(node));
  Recipient* recipient = find_here(run, place, arrival);
  if (recipient == nullptr) return;
  flows_.note(*recipient, run.bytes);
  fanout_.deliver(*recipient, run, header, Handover{});
}

/// The neighbour hub counts, not the link: a frame that came from it never goes back to it, which
/// ends all loops of two hubs.
void Router::to_hub(const Run& run, const proto::FrameHeader& header, HubId hub, Arrival arrival) {
  const NextHop next = routes_.find(hub);
  if (!next.exists() || next.neighbour == from_) return drop(run, proto::DropReason::no_route);
  // Its sender would wait for an acknowledgement or an answer that may not come.
  if (next.one_way && header.has(proto::kFlagReport))
    return drop(run, proto::DropReason::not_allowed);
  Recipient* recipient = find_here(run, next.link, arrival);
  if (recipient != nullptr) fanout_.deliver(*recipient, run, header, Handover{});
}

proto::DropReason Router::why_absent(NodeId node) const {
  if (place_of(node).is_renumbered()) return proto::DropReason::renumbered;
  const bool returns = hub_of(node) == hub_ && nodes_.may_return(index_of(node));
  return returns ? proto::DropReason::away : proto::DropReason::no_such_node;
}

/// A frame of a group of another hub comes over the link that this hub joined the group on, from a
/// node of that hub. Whoever provides the group was looked at there: the names of a new provider
/// may come later than its frames. The sender of a link's frame is told nothing: the message may
/// come over the other link, and subscribers see by its number if it does not.
const GroupMembers* Router::find_away_group(const Run& run, const proto::FrameHeader& header,
                                            Arrival arrival) {
  const GroupId group{header.dst};
  const GroupMembers* members = groups_.find_away(group);
  if (from_ == kOwnHub && !arrival.handed_over()) {
    drop(run, members == nullptr ? proto::DropReason::no_route : proto::DropReason::not_allowed);
    return nullptr;
  }
  auto reason = proto::DropReason::no_subscriber;
  if (members != nullptr) {
    const bool from_parent = arrival.handed_over() || members->parent == from_;
    const bool from_owner = hub_of(NodeId{header.src}) == hub_of(group);
    if (from_parent && from_owner) return members;
    reason = from_parent ? proto::DropReason::not_allowed : proto::DropReason::no_route;
  }
  fanout_.context().tally.drop(reason, run.frames);
  return nullptr;
}

const GroupMembers* Router::find_group(const Run& run, const proto::FrameHeader& header,
                                       Arrival arrival) {
  const GroupId group{header.dst};
  if (hub_of(group) != hub_) return find_away_group(run, header, arrival);
  const GroupMembers* members = groups_.find(index_of(group));
  if (members == nullptr) drop(run, proto::DropReason::no_such_group);
  return members;
}

void Router::to_group(const Run& run, const proto::FrameHeader& header, Arrival arrival) {
  const GroupMembers* members = find_group(run, header, arrival);
  if (members == nullptr) return;
  // Looked at for each run on every shard: no subscriber gets a former provider's frame after one
  // of the next. The last frames of one that left are delivered while nobody provides the group.
  if (members->provider != NodeId{header.src} && members->parent == kOwnHub &&
      (members->provided() || !arrival.handed_over())) {
    return drop(run, members->provided() ? proto::DropReason::not_allowed
                                         : proto::DropReason::no_such_group);
  }
  const MemberList<GroupMember>& here = members->by_shard[fanout_.self().value()];
  const Handover handover{.fan_out = here.size() >= kReferenceRecipients};
  std::uint32_t outcomes = 0;
  deliveries_ += here.size();
  here.for_each([&](const GroupMember& member) {
    Recipient* recipient = fanout_.recipients().find(member.slot, member.generation);
    if (recipient == nullptr) return;
    fanout_.deliver(*recipient, run, header, handover);
    ++outcomes;
  });
  if (!members->paced_by_shard.empty()) {
    outcomes += to_paced(run, header, arrival, members->paced_by_shard[fanout_.self().value()]);
  }
  if (!arrival.handed_over()) {
    outcomes += to_members_elsewhere(run, *members);
    if (members->retain) retained_.keep(run, header, arrival.last_bytes);
  }
  settle(run, outcomes);
}

std::uint32_t Router::to_members_elsewhere(const Run& run, const GroupMembers& members) {
  std::uint32_t outcomes = 0;
  for (std::size_t shard = 0; shard < members.by_shard.size(); ++shard) {
    std::size_t there = members.by_shard[shard].size();
    if (!members.paced_by_shard.empty()) there += members.paced_by_shard[shard].size();
    if (there == 0 || shard == fanout_.self().value()) continue;
    fanout_.hand_over(ShardIndex{static_cast<std::uint8_t>(shard)}, run, there);
    deliveries_ += there;
    ++outcomes;
  }
  return outcomes;
}

/// The conductor publishes a group before it tells a shard of a pace, and this turn may see the one
/// without the other.
std::uint32_t Router::to_paced(const Run& run, const proto::FrameHeader& header, Arrival arrival,
                               const MemberList<PacedMember>& here) {
  const Handover handover{.fan_out = here.size() >= kReferenceRecipients};
  std::uint32_t outcomes = 0;
  deliveries_ += here.size();
  pacer_.begin_run(run, arrival.last_bytes);
  here.for_each([&](const PacedMember& member) {
    Recipient* recipient = fanout_.recipients().find(member.slot, member.generation);
    if (recipient == nullptr) return;
    PacedSubscription* subscription = Pacer::find(*recipient, GroupId{header.dst});
    if (subscription != nullptr) {
      if (pacer_.offer(*subscription, run, header, handover)) ++outcomes;
    } else if (member.was_plain) {
      fanout_.deliver(*recipient, run, header, handover);
      ++outcomes;
    }
  });
  return outcomes;
}

void Router::to_other_shards(const Run& run, std::uint64_t shards, std::size_t deliveries,
                             std::uint32_t& outcomes) {
  for (shards &= ~(std::uint64_t{1} << fanout_.self().value()); shards != 0; shards &= shards - 1) {
    fanout_.hand_over(ShardIndex{static_cast<std::uint8_t>(std::countr_zero(shards))}, run,
                      deliveries);
    deliveries_ += deliveries;
    ++outcomes;
  }
}

void Router::to_provider(const Run& run, const proto::FrameHeader& header, Arrival arrival) {
  const HubId owner = hub_of(GroupId{header.dst});
  if (owner != hub_) return to_hub(run, header, owner, arrival);
  const GroupMembers* members = find_group(run, header, arrival);
  if (members == nullptr) return;
  if (!members->provided()) return drop(run, proto::DropReason::no_such_group);
  if (!members->accepts) return drop(run, proto::DropReason::not_allowed);
  Recipient* recipient = find_here(run, members->provider_place, arrival);
  if (recipient != nullptr) fanout_.deliver(*recipient, run, header, Handover{});
}

/// Each shard gets its own ids and the frame without ids: the tables may change until it looks, and
/// two of them would count a node then, or none.
void Router::to_list(const Run& run, const proto::FrameHeader& header) {
  const proto::ListIds ids(run.bytes + proto::kHeaderSize, header.dst);
  proto::FrameHeader without_ids = header;
  without_ids.dst = 0;
  without_ids.length -= kNodeIdBytes * ids.size();
  Run here;  // made when somebody needs it
  const auto copy_here = [&] {
    if (here.frames == 0) here = fanout_.copy_without_ids(run, without_ids);
  };
  std::uint64_t shards = 0;
  std::uint32_t outcomes = 0;
  deliveries_ += ids.size();
  for (std::uint32_t i = 0; i < ids.size(); ++i) {
    const NodeId node = ids[i];
    if (hub_of(node) != hub_) {
      if (!list_behind(node)) {
        copy_here();
        drop(here, proto::DropReason::no_route);
        ++outcomes;
      }
      continue;
    }
    const NodePlace place = nodes_.find(index_of(node));
    if (place.exists() && place.shard != fanout_.self()) {
      shards |= std::uint64_t{1} << place.shard.value();
      listed_[place.shard.value()].push_back(node);
      continue;
    }
    copy_here();
    to_listed(here, without_ids, node, place);
    ++outcomes;
  }
  for (Behind& behind : behind_) {
    if (behind.ids.empty()) continue;
    copy_here();
    if (behind.link.shard == fanout_.self()) {
      to_listed_behind(here, without_ids, behind.ids, behind.link);
    } else {
      fanout_.hand_over(behind.link.shard, fanout_.copy_for(behind.ids, run, without_ids), 1);
    }
    behind.ids.clear();
    ++outcomes;
  }
  for (; shards != 0; shards &= shards - 1, ++outcomes) {
    const ShardIndex shard{static_cast<std::uint8_t>(std::countr_zero(shards))};
    std::vector<NodeId>& there = listed_[shard.value()];
    fanout_.hand_over(shard, fanout_.copy_for(there, run, without_ids), there.size());
    there.clear();
  }
  settle(run, outcomes);
}

/// Routes a LIST frame that Fanout::copy_for() made on another shard.
void Router::to_listed_here(const Run& run, const proto::FrameHeader& header) {
  const proto::ListIds ids(run.bytes + proto::kHeaderSize, header.dst);
  Run frame = run.share();
  static_cast<void>(frame.take_front({0, list_frame_offset(ids.size())}));
  const proto::FrameHeader without_ids = frame.header();
  if (const HubId hub = hub_of(ids[0]); hub != hub_) {
    std::vector<NodeId>& behind = listed_[fanout_.self().value()];
    for (std::uint32_t i = 0; i < ids.size(); ++i) behind.push_back(ids[i]);
    to_listed_behind(frame, without_ids, behind, routes_.find(hub).link);
    behind.clear();
    return;
  }
  deliveries_ += ids.size();
  for (std::uint32_t i = 0; i < ids.size(); ++i)
    to_listed(frame, without_ids, ids[i], place_of(ids[i]));
  settle(run, ids.size());
}

/// Puts the node with those behind the same link. False: there is no route to it.
bool Router::list_behind(NodeId node) {
  const NextHop next = routes_.find(hub_of(node));
  if (!next.exists() || next.neighbour == from_) return false;
  const auto known = std::ranges::find_if(
      behind_, [&](const Behind& each) { return each.ids.empty() || each.link == next.link; });
  Behind& behind = known != behind_.end() ? *known : behind_.emplace_back();
  behind.link = next.link;
  behind.ids.push_back(node);
  return true;
}

/// One LIST frame for all of them, with their ids.
void Router::to_listed_behind(const Run& frame, const proto::FrameHeader& header,
                              std::span<const NodeId> ids, const NodePlace& link) {
  const bool here = link.exists() && link.shard == fanout_.self();
  Recipient* recipient = here ? fanout_.recipients().find(link.slot, link.generation) : nullptr;
  if (recipient == nullptr) return drop(frame, proto::DropReason::no_route);
  proto::FrameHeader listed = header;
  listed.dst = static_cast<std::uint32_t>(ids.size());
  listed.length += kNodeIdBytes * listed.dst;
  fanout_.deliver(*recipient, fanout_.copy_with_ids(ids, frame, listed), listed, Handover{});
}

/// To one recipient of a LIST frame, here or nowhere.
inline void Router::to_listed(const Run& frame, const proto::FrameHeader& header, NodeId node,
                              const NodePlace& place) {
  const bool here = place.exists() && place.shard == fanout_.self();
  Recipient* recipient = here ? fanout_.recipients().find(place.slot, place.generation) : nullptr;
  if (recipient == nullptr)
    return drop(frame, place.exists() ? proto::DropReason::no_such_node : why_absent(node));
  fanout_.deliver(*recipient, frame, header, Handover{.fan_out = true});
}

/// A BROADCAST to all hubs goes to each neighbour whose shortest way to the source begins with this
/// hub, and each hub takes it from the first hub of its own shortest way. So every hub gets it once
/// (docs/adr/0018-broadcast-along-shortest-ways.md).
void Router::to_everybody(const Run& run, const proto::FrameHeader& header, Arrival arrival) {
  const NodeId dst{header.dst};
  const bool to_all = hub_of(dst) == kEveryHub;
  if (index_of(dst) != kEveryIndex) return drop(run, proto::DropReason::no_such_node);
  if (!to_all && hub_of(dst) != hub_) return to_hub(run, header, hub_of(dst), arrival);
  const HubId source = hub_of(NodeId{header.src});
  const HubId before = source == hub_ ? kOwnHub : routes_.find(source).neighbour;
  if (to_all && !arrival.handed_over() && from_ != before)
    return fanout_.context().tally.drop(proto::DropReason::wrong_way, run.frames);
  std::uint32_t outcomes = 0;
  const RecipientTable& recipients = fanout_.recipients();
  const Handover handover{.fan_out = true};
  for (Recipient* node : recipients.nodes()) {
    if (node->node == NodeId{header.src}) continue;
    fanout_.deliver(*node, run, header, handover);
    ++outcomes;
  }
  std::size_t deliveries = recipients.nodes().size();
  if (to_all) {
    for (Recipient* link : recipients.links()) {
      if (!carries_to(*link, before)) continue;
      fanout_.deliver(*link, run, header, handover);
      ++outcomes;
    }
    deliveries += recipients.links().size();
  }
  deliveries_ += deliveries;
  // Nodes are spread over the shards: there are about as many on each other one.
  const std::uint64_t shards = nodes_.shards() | (to_all ? routes_.shards() : 0);
  if (!arrival.handed_over()) to_other_shards(run, shards, deliveries, outcomes);
  settle(run, outcomes);
}

/// The link is the way to the neighbour at its other end, which is not the one before this hub.
bool Router::carries_to(const Recipient& link, HubId before) const {
  const HubId neighbour = hub_of(link.node);
  const NextHop next = routes_.find(neighbour);
  return neighbour != before && next.neighbour == neighbour && next.link.slot == link.slot &&
         next.link.generation == link.generation;
}

}  // namespace gimnet::hub
