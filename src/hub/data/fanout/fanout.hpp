#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/ids.hpp"
#include "hub/data/egress/egress_context.hpp"
#include "hub/data/fanout/mailbox.hpp"
#include "hub/data/fanout/recipient.hpp"
#include "hub/data/tables/group_table.hpp"
#include "hub/data/tables/node_table.hpp"

namespace gimnet::hub {

/// Counts the recipients that a frame for another shard has there. If that shard never gets the
/// frame, it counts as so many dropped frames. Thread safety: one shard; the tables are published
/// by the conductor.
class ShardRecipients {
 public:
  ShardRecipients(const NodeTable& nodes, const GroupTable& groups)
      : nodes_(nodes), groups_(groups) {}

  /// REQUIRES: a whole frame that the router handed over to that shard.
  [[nodiscard]] std::uint32_t count(ShardIndex shard, const std::byte* frame) const;

 private:
  [[nodiscard]] std::uint32_t count_members(ShardIndex shard, GroupId group) const;

  const NodeTable& nodes_;
  const GroupTable& groups_;
};

inline constexpr std::uint32_t kNodeIdBytes = 4;
/// The offset of the recipients' frame in a LIST frame that another shard gets with so many ids
/// (Fanout::copy_for).
[[nodiscard]] constexpr std::uint32_t list_frame_offset(std::uint32_t ids) {
  return proto::kHeaderSize + kNodeIdBytes * ids;
}

/// Hands frames to their recipients: a reference or a small copy into each outbox on this shard,
/// and for other shards one mailbox entry for a whole stretch of frames. Thread safety: one shard.
class Fanout {
 public:
  /// mailboxes: of all shards, by index.
  Fanout(ShardIndex self, std::vector<Mailbox*> mailboxes, RecipientTable& recipients,
         EgressContext& context, const ShardRecipients& elsewhere);

  /// To one recipient here. Frames larger than it takes are dropped.
  void deliver(Recipient& recipient, const Run& run, const proto::FrameHeader& header,
               Handover handover);
  /// To another shard, which routes the frames itself. Neighbouring frames of one buffer become one
  /// entry; small ones that lie apart, with those for others between them, are copied together for
  /// it. Their order is kept. `deliveries`: recipients there of frames to many.
  void hand_over(ShardIndex to, const Run& run, std::size_t deliveries = 0);
  /// No frame behind the last one will come: what was handed over is posted.
  void post_all();

  /// A LIST frame as its recipients get it: `header`, and the last header.length bytes of the
  /// frame. One copy for all recipients on this shard.
  [[nodiscard]] Run copy_without_ids(const Run& frame, const proto::FrameHeader& header);
  /// Such a copy with the ids in it again, as a link gets it: `header`, the ids, and the frame's
  /// bytes behind its header.
  [[nodiscard]] Run copy_with_ids(std::span<const NodeId> ids, const Run& frame,
                                  const proto::FrameHeader& header);
  /// The same for another shard: a LIST frame with the ids of its nodes, and behind them such a
  /// copy.
  [[nodiscard]] Run copy_for(std::span<const NodeId> ids, const Run& frame,
                             const proto::FrameHeader& header);

  /// The shards (a bit set) that frames were handed over to since the last call.
  [[nodiscard]] std::uint64_t take_posted() { return std::exchange(posted_, 0); }
  /// The shards whose mailbox is more than half full: who sends to them should be read later.
  [[nodiscard]] std::uint64_t crowded() const { return crowded_; }
  /// Looks again; the other shard wakes this one when it has room.
  void look_for_room();

  [[nodiscard]] ShardIndex self() const { return self_; }
  [[nodiscard]] std::size_t shards() const { return mailboxes_.size(); }
  [[nodiscard]] RecipientTable& recipients() { return recipients_; }
  [[nodiscard]] EgressContext& context() { return context_; }
  [[nodiscard]] std::uint64_t take_wakeups() { return std::exchange(wakeups_, 0); }
  /// To each other shard: nothing more will be handed over.
  void post_last();
  /// A word for a sender on another shard.
  void post_word(ShardIndex to, Mail mail);

 private:
  static constexpr std::uint32_t kListChunkBytes = kSharedChunkBytes;
  static constexpr std::uint32_t kGatherChunkBytes = kSharedChunkBytes;
  /// Frames below this are cheaper to copy than to give an entry of their own.
  static constexpr std::uint32_t kGatherBytesMax = 4096;

  /// The frames that go to one other shard in this burst. It may still grow.
  struct Stretch {
    Run open;         ///< one behind the other; none: nothing was handed over since the last post()
    BufferRef chunk;  ///< where those are put together that lay apart
    std::uint32_t chunk_used = 0;
    std::uint32_t deliveries = 0;
  };

  /// Those that are not larger than it takes; the others are dropped.
  void deliver_short_ones(Recipient& recipient, const Run& run, const proto::FrameHeader& header,
                          Handover handover);
  void lose(const Recipient& recipient, const Run& run, const proto::FrameHeader& header,
            proto::DropReason reason);
  void push(Recipient& recipient, const Run& run, const proto::FrameHeader& header,
            Handover handover);
  /// Memory for a LIST frame.
  [[nodiscard]] std::byte* list_room(std::uint32_t bytes);
  /// Returns the place behind them.
  [[nodiscard]] static std::byte* write_ids(std::byte* to, std::span<const NodeId> ids);
  /// `to`: as many bytes as the header says.
  void write_without_ids(std::byte* to, const Run& frame, const proto::FrameHeader& header);
  [[nodiscard]] bool gather(Stretch& stretch, const Run& run);
  void make_room(Stretch& stretch, std::uint32_t bytes);
  [[nodiscard]] std::byte* copy_behind(Stretch& stretch, const Run& run);
  void post(ShardIndex to);
  void put(ShardIndex to, const Run& run, std::uint32_t deliveries = 0);
  /// The mailbox is full: what was sent with BLOCK goes through all the same, since its sender is
  /// not read until there is room; the rest is dropped.
  void put_blocking_only(ShardIndex to, const Run& run);
  /// One frame: dropped for each of its recipients there.
  void drop_for(ShardIndex to, const Run& frame);

  const ShardIndex self_;
  const std::vector<Mailbox*> mailboxes_;
  RecipientTable& recipients_;
  EgressContext& context_;
  const ShardRecipients elsewhere_;
  std::vector<Stretch> stretches_;  ///< by shard
  std::uint64_t open_shards_ = 0;   ///< bit set of those with frames
  BufferRef lists_;                 ///< where LIST frames are copied to
  std::uint32_t lists_used_ = 0;
  std::uint64_t posted_ = 0;
  std::uint64_t crowded_ = 0;
  std::uint64_t wakeups_ = 0;
};

}  // namespace gimnet::hub
