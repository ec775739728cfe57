#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/ids.hpp"
#include "hub/data/fanout/fanout.hpp"
#include "hub/data/fanout/pacer.hpp"
#include "hub/data/fanout/retained_messages.hpp"
#include "hub/data/route/flow_cache.hpp"
#include "hub/data/tables/group_table.hpp"
#include "hub/data/tables/node_table.hpp"
#include "hub/data/tables/route_table.hpp"
#include "proto/frame/frame_header.hpp"

namespace gimnet::hub {

/// Decides where admitted frames go, by table look-up alone, and hands them on. Thread safety: one
/// shard; the tables are published by the conductor.
class Router {
 public:
  struct Parts {
    const NodeTable& nodes;
    const GroupTable& groups;
    const RouteTable& routes;
    Fanout& fanout;
    Pacer& pacer;
    RetainedMessages& retained;
  };
  Router(HubId hub, const Parts& parts)
      : hub_(hub),
        nodes_(parts.nodes),
        groups_(parts.groups),
        routes_(parts.routes),
        fanout_(parts.fanout),
        pacer_(parts.pacer),
        retained_(parts.retained),
        listed_(parts.fanout.shards()) {
    for (auto& ids : listed_) ids.reserve(proto::kListRecipientsMax);
  }

  /// Bytes of `source`'s connection are looked at from here on, or those that other shards handed
  /// over (0).
  void begin_bytes(NodeId source) { flows_.begin(source, nodes_.epoch()); }
  /// The bytes that are looked at came over a link from that hub; 0: not any more.
  void set_neighbour(HubId from) { from_ = from; }
  /// The usual case of small messages, made short: frames from `begin` on that are like those
  /// before them, to different nodes in turns. Returns what was done. REQUIRES: begin <= end;
  /// begin_bytes() was called for them.
  [[nodiscard]] proto::RunView append_repeats(const std::byte* begin, const std::byte* end) {
    return flows_.append(begin, end, fanout_.context().tally);
  }
  /// A recipient goes, or has another connection.
  void forget_flows() { flows_.forget(); }

  /// Frames in that buffer from a connection of this shard. REQUIRES: a run of the parser, admitted
  /// by the ingress gate; begin_bytes() was called for them.
  void route(const BufferRef& buffer, const proto::RunView& view) {
    route(buffer, view, Origin::connection);
  }

  /// Frames that another shard handed over, any mix: to their recipients on this shard, until
  /// deliveries() has come to `deliveries_end`. Returns those that are left.
  [[nodiscard]] Run route_handed_over(const Run& frames, std::uint32_t length_max,
                                      std::uint64_t deliveries_end);

  /// The recipients, since the start, that frames to many were offered to here or have on the shard
  /// that they were handed over to. A run counts as one frame. Frames to one recipient do not
  /// count: the bytes that are read bound them.
  [[nodiscard]] std::uint64_t deliveries() const { return deliveries_; }

  /// A frame that the hub itself made, to a node on whatever shard or behind a link (a REPORT).
  [[nodiscard]] NodePlace place_of(NodeId node) const;

 private:
  enum class Origin : std::uint8_t { connection, another_shard };
  /// The way of a run into this router.
  struct Arrival {
    Origin origin;
    std::uint32_t last_bytes;  ///< of the run's last frame

    [[nodiscard]] bool handed_over() const { return origin == Origin::another_shard; }
  };
  void route(const BufferRef& buffer, const proto::RunView& view, Origin origin) {
    Recipient* const known = flows_.find(view.bytes);
    if (known != nullptr && append(*known, view)) return;
    const Run run{buffer.share(), view.bytes, view.size, view.frames};
    if (known != nullptr) return fanout_.deliver(*known, run, run.header(), Handover{});
    dispatch(run, run.header(), {origin, view.last_bytes});
  }
  /// Right behind the frames that came last, where they are alike and small. False: nothing was
  /// done.
  [[nodiscard]] bool append(Recipient& recipient, const proto::RunView& view) {
    if (view.size - proto::kHeaderSize > recipient.frame_bytes) return false;
    if (!recipient.outbox.append(view.bytes, view.size, view.frames)) return false;
    fanout_.context().tally.queued += view.frames;
    fanout_.context().tally.copied_bytes += view.size;
    return true;
  }
  void dispatch(const Run& run, const proto::FrameHeader& header, Arrival arrival);
  void to_node(const Run& run, const proto::FrameHeader& header, NodeId node, Arrival arrival);
  void to_hub(const Run& run, const proto::FrameHeader& header, HubId hub, Arrival arrival);
  /// nullptr: it is not here. The run was handed over or dropped then.
  [[nodiscard]] Recipient* find_here(const Run& run, const NodePlace& place, Arrival arrival);
  void to_group(const Run& run, const proto::FrameHeader& header, Arrival arrival);
  [[nodiscard]] std::uint32_t to_paced(const Run& run, const proto::FrameHeader& header,
                                       Arrival arrival, const MemberList<PacedMember>& here);
  void to_provider(const Run& run, const proto::FrameHeader& header, Arrival arrival);
  void to_list(const Run& run, const proto::FrameHeader& header);
  void to_listed_here(const Run& run, const proto::FrameHeader& header);
  [[nodiscard]] bool list_behind(NodeId node);
  void to_listed_behind(const Run& frame, const proto::FrameHeader& header,
                        std::span<const NodeId> ids, const NodePlace& link);
  void to_listed(const Run& frame, const proto::FrameHeader& header, NodeId node,
                 const NodePlace& place);
  void to_everybody(const Run& run, const proto::FrameHeader& header, Arrival arrival);
  [[nodiscard]] bool carries_to(const Recipient& link, HubId before) const;
  /// deliveries: at each of them.
  void to_other_shards(const Run& run, std::uint64_t shards, std::size_t deliveries,
                       std::uint32_t& outcomes);
  [[nodiscard]] std::uint32_t to_members_elsewhere(const Run& run, const GroupMembers& members);
  /// nullptr: the run was dropped.
  [[nodiscard]] const GroupMembers* find_group(const Run& run, const proto::FrameHeader& header,
                                               Arrival arrival);
  [[nodiscard]] const GroupMembers* find_away_group(const Run& run,
                                                    const proto::FrameHeader& header,
                                                    Arrival arrival);
  /// REQUIRES: no session has that id.
  [[nodiscard]] proto::DropReason why_absent(NodeId node) const;
  void drop(const Run& run, proto::DropReason reason);
  void settle(const Run& run, std::uint32_t outcomes);

  const HubId hub_;
  const NodeTable& nodes_;
  const GroupTable& groups_;
  const RouteTable& routes_;
  Fanout& fanout_;
  Pacer& pacer_;
  RetainedMessages& retained_;
  FlowCache flows_;
  HubId from_;  ///< at the other end of the link that is read; 0: none is
  /// Nodes of the present LIST that one link leads to.
  struct Behind {
    NodePlace link;
    std::vector<NodeId> ids;  ///< none: the place is free
  };
  std::vector<Behind> behind_;
  std::vector<std::vector<NodeId>> listed_;  ///< of the present LIST, by shard; else empty
  std::uint64_t deliveries_ = 0;
};

}  // namespace gimnet::hub
