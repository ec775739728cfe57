#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <unordered_map>

#include "hub/data/budget.hpp"
#include "hub/data/egress/kept_message.hpp"
#include "hub/data/fanout/pacer.hpp"
#include "hub/data/tables/group_table.hpp"
#include "proto/frame/frame_parser.hpp"

namespace gimnet::hub {

/// The last message of each retained group, kept on its provider's shard, which is where the order
/// of the group's messages is decided; and how a new subscriber gets it, exactly between two
/// others.
///
/// The subscriber's shard asks the provider's for a start. That sends the start and the last
/// message by the mailbox through which it hands over the group's frames: what came before the
/// start the subscriber does not get, what comes after it does. Of a message that is just coming it
/// gets what came so far behind the last one. Where another node provides the group when the start
/// comes, that one's shard is asked; where nobody does, the subscription is open at once.
///
/// Kept messages lie in memory of their own and count by their application data, or by half of
/// their bytes, where that is more: against retained_message_bytes, against retained_budget_bytes
/// of the whole hub, and against half of that for their provider. Of one that is not kept the
/// provider is told (`not_retained`), and an older one is kept no longer, as it would not be the
/// last.
///
/// Thread safety: one shard.
class RetainedMessages {
 public:
  /// `budget`: of the whole hub.
  RetainedMessages(const GroupTable& groups, Fanout& fanout, Pacer& pacer, Budget& budget)
      : groups_(groups),
        fanout_(fanout),
        pacer_(pacer),
        budget_(budget),
        context_(fanout.context()) {}

  // ---- the provider's shard

  /// Frames of a retained group from their provider, as Router::route() gets them.
  void keep(const Run& run, const proto::FrameHeader& header, std::uint32_t last_bytes);
  /// That provider provides the group no more.
  void forget(GroupId group, NodeId provider);
  /// The provider's session is over.
  void forget_provider(NodeId provider);
  /// The provider goes on under another id, and so do its last messages.
  void renumber_provider(NodeId former, NodeId provider);
  /// A subscriber on whatever shard wants to begin.
  void on_start_wanted(const GroupStart& start);
  [[nodiscard]] std::size_t groups() const { return entries_.size(); }

  // ---- the subscriber's shard

  /// The subscription gets nothing until its start.
  void ask_start(PacedSubscription& subscription);
  void on_start(const GroupStart& start);
  /// Frames of the last message that belong to that start.
  void on_handed(const GroupStart& start, const Run& frames);

 private:
  /// A message and what it counts in the budget.
  struct Kept {
    KeptMessage message;
    std::uint64_t charged = 0;
  };
  /// A fragmented message of one lane of which the end has not come.
  struct Arriving {
    bool open = false;
    std::uint32_t number = 0;
    std::uint32_t next_offset = 0;
    Kept kept;
  };
  struct Entry {
    std::uint32_t group = 0;
    NodeId provider;
    Entry* before = nullptr;  ///< of the same provider
    Entry* after = nullptr;
    Kept last;
    std::array<Arriving, proto::kLaneCount> arriving;
    [[nodiscard]] std::uint64_t charged() const;
  };
  /// Of one provider.
  struct Share {
    Entry* first = nullptr;
    std::uint64_t charged = 0;
  };

  [[nodiscard]] Entry& entry(const proto::FrameHeader& header);
  void set_provider(Entry& entry, NodeId provider);
  void leave_provider(Entry& entry);
  void keep_fragment(Entry& entry, const Run& run, const proto::FrameView& frame);
  void begin_fragments(Entry& entry, Arriving& arriving, const Run& run,
                       const proto::FrameView& frame);
  /// The message counts as `bytes` from now on. False: it may not, and counts as before.
  [[nodiscard]] bool charge(const Entry& entry, Kept& kept, std::uint64_t bytes);
  void let_go(const Entry& entry, Kept& kept);
  void let_go_all(Entry& entry);
  void rename_source(KeptMessage& message, NodeId source);
  /// Another node provides the group by now than the one that was asked.
  [[nodiscard]] bool is_of_another(const GroupStart& start) const;
  /// The message of this frame is not kept, nor any older one.
  void refuse(Entry& entry, const Run& run);
  void hand(const GroupStart& start, const KeptMessage& message);
  [[nodiscard]] PacedSubscription* subscription_of(const GroupStart& start) const;

  const GroupTable& groups_;
  Fanout& fanout_;
  Pacer& pacer_;
  Budget& budget_;
  EgressContext& context_;
  std::uint32_t starts_ = 0;  ///< asked for
  std::unordered_map<std::uint32_t, std::unique_ptr<Entry>> entries_;
  /// By provider: sessions end all the time, and most of them had provided nothing.
  std::unordered_map<std::uint32_t, Share> shares_;
};

}  // namespace gimnet::hub
