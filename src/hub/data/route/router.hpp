#pragma once

#include <cstdint>
#include <vector>

#include "base/endian.hpp"
#include "base/ids.hpp"
#include "hub/data/fanout/fanout.hpp"
#include "hub/data/fanout/pacer.hpp"
#include "hub/data/fanout/retained_messages.hpp"
#include "hub/data/route/group_table.hpp"
#include "hub/data/route/node_table.hpp"
#include "hub/data/route/recent_recipients.hpp"
#include "proto/frame/frame_header.hpp"

namespace gimnet::hub {

/// Decides where admitted frames go, by table look-up alone, and hands them on. Thread safety: one
/// shard; the tables are published by the conductor.
class Router {
 public:
  struct Parts {
    const NodeTable& nodes;
    const GroupTable& groups;
    Fanout& fanout;
    Pacer& pacer;
    RetainedMessages& retained;
  };
  Router(HubId hub, const Parts& parts)
      : hub_(hub),
        nodes_(parts.nodes),
        groups_(parts.groups),
        fanout_(parts.fanout),
        pacer_(parts.pacer),
        retained_(parts.retained),
        listed_(parts.fanout.shards()) {
    for (auto& ids : listed_) ids.reserve(proto::kListRecipientsMax);
  }

  /// The usual case of small messages, made short: to a node here that got some with the same
  /// header in this turn. False: nothing was done, route() them. REQUIRES: as route().
  [[nodiscard]] bool append(const std::byte* frames, std::uint32_t size, std::uint32_t count) {
    // Only of these is dst all that decides where they go.
    if (static_cast<proto::Kind>(frames[proto::kKindOffset]) != proto::Kind::unicast) return false;
    const NodeId node{load_le<std::uint32_t>(frames + proto::kDstOffset)};
    if (hub_of(node) != hub_) return false;
    const NodePlace place = nodes_.find(index_of(node));
    if (place.shard != fanout_.self()) return false;
    // No session has generation 0, so that nobody is found where none exists.
    Recipient* recipient = fanout_.recipients().find(place.slot, place.generation);
    if (recipient == nullptr || size - proto::kHeaderSize > recipient->frame_bytes) return false;
    if (!recipient->outbox.append(frames, size, count)) return false;
    fanout_.context().tally.queued += count;
    fanout_.context().tally.copied_bytes += size;
    recent_.note(*recipient, frames);
    return true;
  }

  /// Other bytes are looked at from here on than before.
  void begin_bytes() { recent_.forget(); }
  /// Shorter still: frames from `begin` on that are like those that append() took from the same
  /// bytes, to different nodes in turns. Returns what was done. REQUIRES: begin <= end;
  /// begin_bytes() was called for them.
  [[nodiscard]] proto::RunView append_repeats(const std::byte* begin, const std::byte* end) {
    return recent_.append(begin, end, fanout_.context().tally);
  }

  /// Frames from a connection of this shard. REQUIRES: whole legal frames with one header but for
  /// the length, alone if LIST, FRAGMENT, EXT or LATEST; admitted by the ingress gate; the last one
  /// has `last_bytes`.
  void route(const Run& run, const proto::FrameHeader& header, std::uint32_t last_bytes) {
    dispatch(run, header, {false, last_bytes});
  }

  /// Frames that another shard handed over, any mix: to their recipients on this shard, until
  /// deliveries() has come to `deliveries_end`. Returns those that are left.
  [[nodiscard]] Run route_handed_over(const Run& frames, std::uint32_t length_max,
                                      std::uint64_t deliveries_end);

  /// How many recipients frames to many were offered to, or are where they were handed over, since
  /// the start; a run counts as one frame. Frames to one are bounded by what is read.
  [[nodiscard]] std::uint64_t deliveries() const { return deliveries_; }

  /// A frame that the hub itself made, to a node on whatever shard (a REPORT).
  [[nodiscard]] NodePlace place_of(NodeId node) const;

 private:
  /// How a run came here.
  struct Arrival {
    bool handed_over;          ///< by another shard
    std::uint32_t last_bytes;  ///< of the run's last frame
  };
  void dispatch(const Run& run, const proto::FrameHeader& header, Arrival arrival);
  void to_node(const Run& run, const proto::FrameHeader& header, NodeId node, Arrival arrival);
  void to_place(const Run& run, const proto::FrameHeader& header, const NodePlace& place,
                Arrival arrival);
  void to_group(const Run& run, const proto::FrameHeader& header, Arrival arrival);
  [[nodiscard]] std::uint32_t to_paced(const Run& run, const proto::FrameHeader& header,
                                       Arrival arrival, const MemberList<PacedMember>& here);
  void to_provider(const Run& run, const proto::FrameHeader& header, Arrival arrival);
  void to_list(const Run& run, const proto::FrameHeader& header);
  void to_listed_here(const Run& run, const proto::FrameHeader& header);
  void to_listed(const Run& frame, const proto::FrameHeader& header, NodeId node,
                 const NodePlace& place);
  void to_everybody(const Run& run, const proto::FrameHeader& header, Arrival arrival);
  /// deliveries: at each of them.
  void to_other_shards(const Run& run, std::uint64_t shards, std::size_t deliveries,
                       std::uint32_t& outcomes);
  [[nodiscard]] std::uint32_t to_members_elsewhere(const Run& run, const GroupMembers& members);
  [[nodiscard]] const GroupMembers* find_group(const Run& run, const proto::FrameHeader& header);
  /// REQUIRES: no session has that id.
  [[nodiscard]] proto::DropReason why_absent(NodeId node) const;
  void drop(const Run& run, proto::DropReason reason);
  void settle(const Run& run, std::uint32_t outcomes);

  const HubId hub_;
  const NodeTable& nodes_;
  const GroupTable& groups_;
  Fanout& fanout_;
  Pacer& pacer_;
  RetainedMessages& retained_;
  RecentRecipients recent_;
  std::vector<std::vector<NodeId>> listed_;  ///< of the present LIST, by shard; else empty
  std::uint64_t deliveries_ = 0;
};

}  // namespace gimnet::hub
