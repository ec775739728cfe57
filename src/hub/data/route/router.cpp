#include "hub/data/route/router.hpp"

#include <bit>
#include <cstring>

#include "hub/data/route/shared_list.hpp"
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
  return hub_of(node) == hub_ ? nodes_.find(index_of(node)) : NodePlace{};
}

void Router::dispatch(const Run& run, const proto::FrameHeader& header, Arrival arrival) {
  fanout_.context().owner.check_here();
  switch (header.kind) {
    case proto::Kind::group:
      return to_group(run, header, arrival);
    case proto::Kind::list:
      return to_list(run, header, arrival);
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
  begin_bytes();
  while (true) {
    const proto::RunView repeats = append_repeats(next, end);
    next += repeats.size;
    left -= repeats.frames;
    fanout_.context().tally.queued -= repeats.frames;
    if (next == end) return Run{};
    if (deliveries_ >= deliveries_end) {
      return Run{frames.buffer.share(), next, static_cast<std::uint32_t>(end - next), left};
    }
    const proto::NextRun found = proto::next_run(next, end, length_max);
    GIMNET_CHECK(found.found == proto::Found::run);  // the sending shard parsed them
    next += found.run.size;
    left -= found.run.frames;
    fanout_.context().tally.queued -= found.run.frames;
    if (append(found.run.bytes, found.run.size, found.run.frames)) continue;
    const Run run{frames.buffer.share(), found.run.bytes, found.run.size, found.run.frames};
    dispatch(run, run.header(), {true, found.run.last_bytes});
  }
}

inline void Router::to_place(const Run& run, const proto::FrameHeader& header,
                             const NodePlace& place, Arrival arrival) {
  if (place.shard != fanout_.self()) {
    // A frame that was handed over here and would have to go on is for a node that left meanwhile.
    if (arrival.handed_over) return drop(run, proto::DropReason::no_such_node);
    return fanout_.hand_over(place.shard, run);
  }
  Recipient* recipient = fanout_.recipients().find(place.slot, place.generation);
  if (recipient == nullptr) return drop(run, proto::DropReason::no_such_node);
  fanout_.deliver(*recipient, run, header, Handover{});
}

void Router::to_node(const Run& run, const proto::FrameHeader& header, NodeId node,
                     Arrival arrival) {
  if (hub_of(node) != hub_) return drop(run, proto::DropReason::no_route);
  const NodePlace place = nodes_.find(index_of(node));
  if (!place.exists()) return drop(run, why_absent(node));
  to_place(run, header, place, arrival);
}

proto::DropReason Router::why_absent(NodeId node) const {
  if (place_of(node).is_renumbered()) return proto::DropReason::renumbered;
  const bool returns = hub_of(node) == hub_ && nodes_.may_return(index_of(node));
  return returns ? proto::DropReason::away : proto::DropReason::no_such_node;
}

const GroupMembers* Router::find_group(const Run& run, const proto::FrameHeader& header) {
  const GroupId group{header.dst};
  if (hub_of(group) != hub_) {
    drop(run, proto::DropReason::no_route);
    return nullptr;
  }
  const GroupMembers* members = groups_.find(index_of(group));
  if (members == nullptr) drop(run, proto::DropReason::no_such_group);
  return members;
}

void Router::to_group(const Run& run, const proto::FrameHeader& header, Arrival arrival) {
  const GroupMembers* members = find_group(run, header);
  if (members == nullptr) return;
  // What was handed over was looked at by the shard that took it in.
  if (!arrival.handed_over && members->provider != NodeId{header.src}) {
    return drop(
        run, members->ends() ? proto::DropReason::no_such_group : proto::DropReason::not_allowed);
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
  if (!arrival.handed_over) {
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
  const GroupMembers* members = find_group(run, header);
  if (members == nullptr) return;
  if (members->ends()) return drop(run, proto::DropReason::no_such_group);
  if (!members->accepts) return drop(run, proto::DropReason::not_allowed);
  to_place(run, header, members->provider_place, arrival);
}

/// A LIST frame while it goes to its recipients on this shard.
struct Router::Listed {
  Listed(const Run& run_, const proto::FrameHeader& header, const SharedList& list_)
      : run(run_), list(list_), local(header) {
    local.dst = 0;
    local.length -= list.bytes();
  }
  const Run& run;
  const SharedList list;
  proto::FrameHeader local;  ///< as its recipients get it
  Run shared;  ///< header and payload without the ids, one for all, made when the first one needs
               ///< it
};

void Router::to_list(const Run& run, const proto::FrameHeader& header, Arrival arrival) {
  if (arrival.handed_over) return to_listed_here(run, header);
  // Nobody else has the frame yet: it is told in it whose business each id is, for the other
  // shards.
  std::byte* const frame = run.buffer->data + (run.bytes - run.buffer->data);
  std::byte* const ids = frame + proto::kHeaderSize;
  Listed listed(run, header, SharedList::find(ids, header.dst, hub_));
  std::uint64_t shards = 0;
  std::uint32_t outcomes = 0;
  deliveries_ += header.dst;
  for (std::uint32_t i = listed.list.first; i < listed.list.end(); ++i) {
    const NodeId node = SharedList::id_at(ids, i);
    const NodePlace place = nodes_.find(index_of(node));
    if (place.exists() && place.shard != fanout_.self()) {
      SharedList::mark(ids, i, node, place.shard);
      shards |= std::uint64_t{1} << place.shard.value();
      continue;
    }
    to_listed(listed, node, place);
    ++outcomes;
  }
  if (const std::uint32_t foreign = header.dst - listed.list.count; foreign != 0) {
    drop_listed(listed, foreign, proto::DropReason::no_route);
    outcomes += foreign;
  }
  if (shards != 0) {
    store_le(frame + proto::kDstOffset, listed.list.pack());
    // How many of them are there is not counted: no more than all.
    to_other_shards(run, shards, header.dst, outcomes);
  }
  settle(run, outcomes);
}

/// The tables may have changed since another shard looked: what it left to this one is this one's
/// to count, and nothing else.
void Router::to_listed_here(const Run& run, const proto::FrameHeader& header) {
  const std::byte* const ids = run.bytes + proto::kHeaderSize;
  Listed listed(run, header, SharedList::unpack(header.dst));
  std::uint32_t outcomes = 0;
  deliveries_ += listed.list.size;
  for (std::uint32_t i = listed.list.first; i < listed.list.end(); ++i) {
    const NodeId found = SharedList::id_at(ids, i);
    const auto node = make_id<NodeId>(hub_, index_of(found));
    if (found != SharedList::marked(node, fanout_.self())) continue;
    to_listed(listed, node, place_of(node));
    ++outcomes;
  }
  settle(run, outcomes);
}

/// To one recipient of the frame, here or nowhere.
inline void Router::to_listed(Listed& listed, NodeId node, const NodePlace& place) {
  const bool here = place.exists() && place.shard == fanout_.self();
  Recipient* recipient = here ? fanout_.recipients().find(place.slot, place.generation) : nullptr;
  if (recipient == nullptr) {
    return drop_listed(listed, 1,
                       place.exists() ? proto::DropReason::no_such_node : why_absent(node));
  }
  if (listed.shared.frames == 0)
    listed.shared = fanout_.cut_ids(listed.run, listed.local, listed.list.bytes());
  fanout_.deliver(*recipient, listed.shared, listed.local, Handover{.fan_out = true});
}

void Router::drop_listed(const Listed& listed, std::uint32_t outcomes, proto::DropReason reason) {
  const SharedList::FrameStart start = listed.list.as_sent(listed.run.bytes, hub_);
  fanout_.context().drops.drop(start.data(), outcomes, reason);
}

void Router::to_everybody(const Run& run, const proto::FrameHeader& header, Arrival arrival) {
  const NodeId dst{header.dst};
  if (hub_of(dst) != hub_ && hub_of(dst) != kEveryHub)
    return drop(run, proto::DropReason::no_route);
  if (index_of(dst) != kEveryIndex) return drop(run, proto::DropReason::no_such_node);
  std::uint32_t outcomes = 0;
  const std::size_t slots = fanout_.recipients().by_slot().size();
  deliveries_ += slots;
  const Handover handover{.fan_out = true};
  for (Recipient* recipient : fanout_.recipients().by_slot()) {
    if (recipient == nullptr || recipient->node == NodeId{header.src}) continue;
    fanout_.deliver(*recipient, run, header, handover);
    ++outcomes;
  }
  // Nodes are spread over the shards: there are about as many on each other one.
  if (!arrival.handed_over) to_other_shards(run, nodes_.shards(), slots, outcomes);
  settle(run, outcomes);
}

}  // namespace gimnet::hub
