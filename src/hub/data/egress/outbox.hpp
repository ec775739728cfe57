#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>

#include "hub/data/egress/copy_chunk.hpp"
#include "hub/data/egress/counted_groups.hpp"
#include "hub/data/egress/egress_context.hpp"
#include "hub/data/egress/lane_queue.hpp"
#include "hub/data/egress/open_messages.hpp"
#include "hub/data/egress/pause_book.hpp"
#include "hub/data/egress/resume_buffer.hpp"
#include "hub/data/egress/run.hpp"
#include "hub/observe/session_gauges.hpp"
#include "proto/frame/flow.hpp"

namespace gimnet::hub {

/// The frames that were dropped to make room, for one reason, since the connection's node was told
/// last, and the node of which most bytes waited in that lane at the latest drop. Thread safety:
/// one shard.
class UntoldLosses {
 public:
  /// `lost` does not wait in the lane, or no longer.
  void add(const Entry& lost, LaneQueue& lane, proto::DropReason reason) {
    frames_ += lost.frames;
    reason_ = reason;
    const std::uint8_t fullest = lane.sources().fullest();
    if (const NodeId sender{lost.run.header().src}; SourceBytes::place_of(sender) == fullest) {
      source_ = sender;
    } else if (SourceBytes::place_of(source_) != fullest || source_ == NodeId{}) {
      source_ = lane.source_at(fullest);
    }
  }
  [[nodiscard]] bool any() const { return frames_ != 0; }
  [[nodiscard]] proto::flow::Dropped message() const { return {reason_, source_, frames_}; }

 private:
  std::uint64_t frames_ = 0;
  NodeId source_;
  proto::DropReason reason_ = proto::DropReason::none;
};

/// The way of a run into an outbox.
struct Handover {
  bool fan_out = false;  ///< the same bytes go to many: keep a reference instead of a copy
};

/// The frames that wait to be written to one connection: control frames, and four lanes of messages
/// with the policies of docs/protocol.md, section 5. While the connection takes everything at once,
/// push() is a few instructions: policies begin when something waits. A connection that only keeps
/// alive has no lanes; they are made for its first data frame. Thread safety: one shard. Ownership:
/// references to buffers.
class Outbox {
 public:
  Outbox() = default;
  Outbox(const Outbox&) = delete;
  Outbox& operator=(const Outbox&) = delete;

  /// The usual case of small messages, made short: frames like those that came last are copied
  /// right behind them. False: nothing was done, push() them. REQUIRES: as push(), of which one was
  /// made in this turn. The caller counts them as queued and copied.
  [[nodiscard, gnu::always_inline]] bool append(const std::byte* frames, std::uint32_t size,
                                                std::uint32_t count) {
    if (!lanes_ || !lanes_->open.takes(frames, size) || size >= kAppendBytesMax) return false;
    lanes_->open.append(frames, size, count);
    chunk_.take(size);
    return true;
  }
  /// Nothing is appended before the next push().
  void close_run() {
    if (lanes_) lanes_->open.close();
  }
  /// Runs below this are cheaper to copy than to reference: up to a fifth of in_turns at 1 to 2
  /// KiB, and the same from there to 4 KiB (docs/why-these-figures.md;
  /// bench/hub/data/egress/outbox_bench.cpp).
  static constexpr std::uint32_t kAppendBytesMax = 4096;
  /// Data frames for this connection. Every frame ends in a lane or in the drop book.
  /// REQUIRES: `run` holds whole legal frames with one header but for the length; alone if
  /// FRAGMENT, EXT or LATEST.
  void push(const Run& run, const proto::FrameHeader& header, Handover handover,
            EgressContext& context);

  /// A frame of FLOW, LINK, NS or CTRL: goes before all lanes. Returns false if too much of that
  /// waits: the peer asks and does not listen.
  [[nodiscard]] bool push_control(std::span<const std::byte> frame, EgressContext& context) {
    return push_control(frame, context, context.limits.control_bytes);
  }
  /// The same with another limit on what waits.
  [[nodiscard]] bool push_control(std::span<const std::byte> frame, EgressContext& context,
                                  std::uint64_t bytes_most);
  /// Puts frames as push_control() takes them ahead of all else, whatever their size. They do not
  /// count against the limit on control frames: a peer that comes back to much news must still be
  /// able to ask.
  void push_first_control(std::span<const std::byte> frames, EgressContext& context);

  /// It is a link's: what waits in it counts against the budget of links, and its lanes have the
  /// limit of on_link_took().
  void set_link() { link_ = true; }
  /// The budget against which what waits in it counts.
  [[nodiscard]] BudgetLease& budget(EgressContext& context) const { return memory(context).budget; }
  [[nodiscard]] std::uint64_t budget_bytes(const Limits& limits) const {
    return link_ ? limits.link_budget_bytes : limits.budget_bytes;
  }
  /// BLOCK of other hubs may fill this part of the budget for one node or link.
  static constexpr std::uint64_t kPartFromAfar = 8;
  /// In each lane of a link as many bytes may wait as it takes in so long: more would only be older
  /// when they arrive. At least two frames of each half of a lane, at most what 1 Gbit/s takes in
  /// 67 ms.
  static constexpr std::uint64_t kLinkLaneMs = 200;
  static constexpr std::uint64_t kLinkLaneBytesMin = 256 * 1024;
  static constexpr std::uint64_t kLinkLaneBytesMax = 8 << 20;
  /// The link took so many bytes in the last kLinkLaneMs. `emptied`: nothing waited for a moment,
  /// so it could have taken more. REQUIRES: set_link().
  void on_link_took(std::uint64_t bytes, bool emptied);

  /// Is told of messages of counted groups that are dropped here; nullptr: nobody is.
  void set_counted_groups(CountedGroups* counted) { counted_ = counted; }
  [[nodiscard]] const CountedGroups* counted_groups() const { return counted_; }
  /// Counters of this session (accepted, delivered, dropped). Valid until: as SessionGauges.
  void set_counters(SessionCounters& counters) { counters_ = &counters; }
  [[nodiscard]] SessionCounters* counters() const { return counters_; }
  /// So many frames that were for this connection are dropped, here or on their way here.
  void count_dropped(std::uint64_t frames, proto::DropReason reason) const {
    if (counters_ == nullptr) return;
    counters_->dropped.add(frames);
    if (reason == proto::DropReason::queue_full) counters_->queue_full.add(frames);
  }

  /// The buffer of frames that were written and are not confirmed: they count as this connection's
  /// bytes. Null: nothing is kept. Valid until: the next call, which comes before the buffer goes.
  void set_resume(ResumeBuffer* resume) { resume_ = resume; }
  /// So many bytes more, or fewer, are held by the pacer for this connection.
  void add_paced(std::uint64_t bytes, EgressContext& context) {
    if (!waits_here()) waiting_since_ms_ = context.now_ms;
    paced_bytes_ += bytes;
    if (paced_bytes_ == bytes) note_waiting(context);
  }
  void remove_paced(std::uint64_t bytes, EgressContext& context) {
    paced_bytes_ -= bytes;
    if (paced_bytes_ == 0) note_waiting(context);
  }
  /// All that waits for this connection: here with the memory of the entries, in the pacer, and
  /// until it is confirmed.
  [[nodiscard]] std::uint64_t held_bytes() const;
  /// A connection that had nothing waiting within so long keeps up: it may have a burst.
  static constexpr std::uint64_t kBurstMs = 1'000;
  /// Does a share bound what waits for this connection? While memory is scarce, unless it keeps up
  /// and there is memory to spare.
  [[nodiscard]] bool has_share(EgressContext& context) const {
    const BudgetLease& own = budget(context);
    if (!own.scarce()) return false;
    const bool keeps_up = !waits_here() || context.now_ms - waiting_since_ms_ < kBurstMs;
    return !keeps_up || !own.has_spare();
  }
  /// With so many bytes more this connection would have more than its share.
  [[nodiscard]] bool over_share(std::uint64_t bytes, EgressContext& context) const {
    return has_share(context) && held_bytes() + bytes > budget(context).share_bytes();
  }
  /// Lets frames go that were written and not confirmed, oldest first, as far as it takes to have
  /// room for so many bytes in the share.
  void release_written(std::uint64_t bytes, EgressContext& context);

  /// Would a message of so many bytes that is not sent with BLOCK wait in the lane, and no other be
  /// dropped for it? Besides what is being written one may always wait, however large it is.
  [[nodiscard]] bool has_room(std::uint64_t bytes, std::size_t lane, const Limits& limits) const {
    return !lanes_ || !lanes_->queues[lane].holds_whole() || bytes <= room(lane, false, limits);
  }
  /// Messages of that group of which the end still waits in a lane.
  [[nodiscard]] std::uint64_t waiting_messages(GroupId group);
  /// Frames that were for this connection did not get here. REQUIRES: as push().
  void tell_lost(const Run& run, const proto::FrameHeader& header) const {
    if (counted_ != nullptr) counted_->on_run_lost(run, header);
  }

  /// Frames were dropped to make room, and the node was not told yet.
  [[nodiscard]] bool has_untold_losses() const { return has_untold_losses_; }
  /// Calls tell(const proto::flow::Dropped&) for each reason, which returns whether the node is
  /// told. REQUIRES: there are some.
  template <class Tell>
  void tell_losses(Tell&& tell) {
    has_untold_losses_ = false;
    for (UntoldLosses* losses : {&lanes_->of_full_lanes, &lanes_->of_short_memory}) {
      if (!losses->any()) continue;
      if (tell(losses->message())) *losses = UntoldLosses{};
      has_untold_losses_ |= losses->any();
    }
  }

  /// Frames of an earlier connection, to be written again before all lanes.
  [[nodiscard]] RunQueue& replay() { return lanes().replay; }
  /// They will not be written again.
  void drop_replay(proto::DropReason reason, EgressContext& context);

  [[nodiscard]] bool empty() const { return waiting_bytes() == 0; }
  [[nodiscard]] std::uint64_t waiting_bytes() const;
  /// Bytes of messages that are not LATEST: what makes a consumer slow.
  [[nodiscard]] std::uint64_t stale_bytes() const;
  [[nodiscard]] bool has_block() const {
    return lanes_ && std::ranges::any_of(lanes_->queues, &LaneQueue::block_bytes);
  }
  [[nodiscard]] bool paused_anyone() const { return lanes_ && !lanes_->pauses.empty(); }

  /// After a flush that left something: what stays is counted against the budget, small frames are
  /// copied out of their slabs, and policies apply from here on.
  void settle(EgressContext& context);
  /// The same for one run, also for what is kept after it was written. While memory is scarce
  /// every frame is copied: one of 64 KiB would keep a read buffer of 320 KiB.
  void settle_run(Run& run, bool shared, EgressContext& context);
  /// After a flush that left nothing.
  void on_emptied(EgressContext& context);
  /// After frames left: tells paused senders that there is room.
  void signal_room(EgressContext& context);
  /// Now and then: repeats to senders what they would forget.
  void say_pauses_again(EgressContext& context) const {
    if (paused_anyone()) lanes_->pauses.say_again(context.signals);
  }

  /// The recipient took nothing for too long: every message sent with BLOCK goes.
  void time_out_block(EgressContext& context) {
    drop_if([](const Entry& entry) { return entry.block && !entry.touched; },
            proto::DropReason::timed_out, context);
  }
  /// Another program has the connection now: what was sent to the former one alone goes, messages
  /// that were begun included. REQUIRES: nothing was written to the connection yet.
  void drop_addressed(EgressContext& context) {
    drop_if([](const Entry& entry) { return entry.is_addressed(); }, proto::DropReason::away,
            context);
  }
  /// The session is over, or its connection and nothing may wait: all lanes go.
  void drop_all(proto::DropReason reason, EgressContext& context);
  /// The connection is gone: control frames that wait mean nothing to the next one.
  void clear_control() { control_.clear(); }

  /// Nothing was written for a while: gives back memory that only a busy connection needs.
  void trim();

  // For the gather writer, which takes entries out
  [[nodiscard]] RunQueue& control() { return control_; }
  /// Has it had anything but control frames? Not since it was idle for a while.
  [[nodiscard]] bool has_lanes() const { return lanes_ != nullptr; }
  [[nodiscard]] LaneQueue& lane(std::size_t lane) {
    lanes().open.close();
    return lanes_->queues[lane];
  }
  [[nodiscard]] std::array<std::uint64_t, proto::kLaneCount>& owed() { return lanes().owed; }
  void lose(Entry& entry, proto::DropReason reason, EgressContext& context);

 private:
  /// The part that only data frames need.
  struct Lanes {
    OpenRun open;  ///< first, with all that append() looks at
    std::array<LaneQueue, proto::kLaneCount> queues;
    std::array<std::uint64_t, proto::kLaneCount>
        owed{};  ///< bytes due to a waiting lane, see GatherWriter
    RunQueue replay;
    std::uint64_t charged_bytes = 0;  ///< of the queues' entries, counted against the budget
    PauseBook pauses;
    UntoldLosses of_full_lanes;
    UntoldLosses of_short_memory;
    OpenMessages open_messages;
  };
  /// A waiting piece below this is copied out of its slab, which it would keep from being used
  /// again.
  static constexpr std::uint32_t kSettleBytesMax = kSharedChunkBytes;

  [[nodiscard]] Lanes& lanes() {
    if (!lanes_) lanes_ = std::make_unique<Lanes>();
    return *lanes_;
  }
  [[nodiscard]] Entry make_entry(const Run& run, const proto::FrameHeader& header,
                                 Handover handover, bool has_room, EgressContext& context);
  [[nodiscard]] Run copy(const Run& run, EgressContext& context);
  [[nodiscard]] std::uint64_t room(std::size_t lane, bool block, const Limits& limits) const {
    return lanes_->queues[lane].room(block, lane_bytes(lane, block, limits));
  }
  /// The limit of the lane. For BLOCK that of a link is as that of a node: a limit that shrinks
  /// below what waits would have its senders held, and one that is soon empty gives a link to
  /// senders nearby alone (docs/adr/0017-pause-goes-to-the-sender.md).
  [[nodiscard]] std::uint64_t lane_bytes(std::size_t lane, bool block, const Limits& limits) const {
    return link_lane_bytes_ != 0 && !block ? link_lane_bytes_ : limits.lane_bytes(lane);
  }
  [[nodiscard]] const WaitingMemory& memory(EgressContext& context) const {
    return context.memory[link_ ? 1 : 0];
  }
  [[nodiscard]] bool fits(const Entry& entry, std::size_t lane, const Limits& limits) const {
    return entry.size <= room(lane, entry.block, limits);
  }

  /// The messages for which which(const Entry&) is true go. Paused senders go on if there is room.
  template <class Which>
  void drop_if(const Which& which, proto::DropReason reason, EgressContext& context) {
    close_run();
    if (!lanes_) return;
    for (LaneQueue& lane : lanes_->queues)
      lane.lose_all(which, [&](Entry& entry) { lose(entry, reason, context); });
    signal_room(context);
  }
  /// Something waits that the connection could have taken: here, or in the pacer.
  [[nodiscard]] bool waits_here() const { return backlog_ || paced_bytes_ != 0; }
  void note_waiting(EgressContext& context);
  /// While memory is scarce frames are taken in pieces that fit in a chunk: a longer one would stay
  /// for the sake of its last frame.
  void push_in_pieces(const Run& run, const proto::FrameHeader& header, Handover handover,
                      EgressContext& context);
  /// Makes room for the entry in the connection's share, as far as its policy allows.
  void make_share(const Entry& entry, const proto::FrameHeader& header, EgressContext& context);
  /// Is memory for waiting data used up, whatever room the entry's lane has?
  [[nodiscard]] bool memory_refuses(const Entry& entry, EgressContext& context) const {
    return budget(context).exhausted() ||
           (backlog_ && !entry.block && over_share(entry.size, context));
  }
  /// Has neither its lane nor, while memory is scarce, the connection's share room for it?
  [[nodiscard]] bool finds_no_room(const Entry& entry, std::size_t lane,
                                   EgressContext& context) const {
    return !fits(entry, lane, context.limits) || (backlog_ && over_share(entry.size, context));
  }
  void admit(Entry entry, const proto::FrameHeader& header, EgressContext& context);
  void admit_to_full(Entry entry, const proto::FrameHeader& header, EgressContext& context);
  void make_room(const Entry& entry, std::size_t lane_index, EgressContext& context);
  bool drop_for_room(std::size_t lane_index, proto::DropReason reason, EgressContext& context);
  void lose_for_room(Entry& lost, std::size_t lane_index, proto::DropReason reason,
                     EgressContext& context);
  /// A message sent with BLOCK came although its lane is full: asks its sender to pause. Returns
  /// false if it came all the same, although it was held: the message is not to be taken.
  [[nodiscard]] bool ask_to_pause(const Entry& entry, const proto::FrameHeader& header,
                                  EgressContext& context);
  [[nodiscard]] bool join_message(Entry& entry, const proto::FrameHeader& header,
                                  EgressContext& context);
  [[nodiscard]] Run copy_control(std::span<const std::byte> frame, EgressContext& context);
  void replace_latest(EgressContext& context);
  /// Memory of the entries. Many small messages that cannot form runs take more for those than for
  /// their bytes.
  [[nodiscard]] std::uint64_t entry_bytes() const;
  [[nodiscard]] std::uint64_t data_bytes() const {
    std::uint64_t bytes = 0;
    if (lanes_)
      for (const LaneQueue& queue : lanes_->queues) bytes += queue.bytes();
    return bytes;
  }

  RunQueue control_;
  std::unique_ptr<Lanes> lanes_;  ///< nullptr: no data since it was made or trimmed
  CountedGroups* counted_ = nullptr;
  SessionCounters* counters_ = nullptr;
  ResumeBuffer* resume_ = nullptr;
  std::uint64_t paced_bytes_ = 0;
  CopyChunk chunk_;  ///< where copies go
  bool backlog_ = false;
  bool waits_ = false;  ///< counted among the connections that have data waiting
  bool has_untold_losses_ = false;
  bool link_ = false;
  std::uint32_t link_lane_bytes_ = 0;   ///< 0: no link, or not measured: as for a node
  std::uint64_t waiting_since_ms_ = 0;  ///< while waits_here()
};

}  // namespace gimnet::hub
