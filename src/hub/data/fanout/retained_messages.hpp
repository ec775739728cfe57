#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <unordered_map>

#include "hub/data/egress/kept_message.hpp"
#include "hub/data/fanout/pacer.hpp"
#include "hub/data/route/group_table.hpp"

namespace gimnet::hub {

/// The last message of each retained group, kept on its provider's shard, which is where the order
/// of the group's messages is decided; and how a new subscriber gets it, exactly between two
/// others.
///
/// The subscriber's shard asks the provider's for a start. That sends the start and the last
/// message by the mailbox through which it hands over the group's frames: what came before the
/// start the subscriber does not get, what comes after it does. Of a message that is just coming it
/// gets what came so far behind the last one.
///
/// Thread safety: one shard. Limits: retained_bytes for one message, and the budget.
class RetainedMessages {
 public:
  RetainedMessages(const GroupTable& groups, Fanout& fanout, Pacer& pacer)
      : groups_(groups), fanout_(fanout), pacer_(pacer), context_(fanout.context()) {}

  // ---- the provider's shard

  /// Frames of a retained group from their provider, as Router::route() gets them.
  void keep(const Run& run, const proto::FrameHeader& header);
  /// The group is gone.
  void forget(GroupId group);
  /// The provider's session is over.
  void forget_provider(NodeId provider);
  /// The provider goes on under another id.
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
  /// A fragmented message of one lane of which the end has not come.
  struct Arriving {
    bool open = false;
    std::uint32_t number = 0;
    std::uint32_t next_offset = 0;
    KeptMessage message;
  };
  struct Entry {
    std::uint32_t group = 0;
    NodeId provider;
    Entry* before = nullptr;  ///< of the same provider
    Entry* after = nullptr;
    KeptMessage last;
    std::array<Arriving, proto::kLaneCount> arriving;
  };

  [[nodiscard]] Entry& entry(const proto::FrameHeader& header);
  void set_provider(Entry& entry, NodeId provider);
  void leave_provider(Entry& entry);
  void keep_fragment(Entry& kept, const Run& run, const proto::FrameHeader& header);
  [[nodiscard]] bool may_keep(Entry& kept, std::uint64_t bytes);
  void hand(const GroupStart& start, const KeptMessage& message);
  [[nodiscard]] PacedSubscription* subscription_of(const GroupStart& start) const;

  const GroupTable& groups_;
  Fanout& fanout_;
  Pacer& pacer_;
  EgressContext& context_;
  std::uint32_t starts_ = 0;  ///< asked for
  std::unordered_map<std::uint32_t, std::unique_ptr<Entry>> entries_;
  /// The first entry of each provider: sessions end all the time, and most of them had provided
  /// nothing.
  std::unordered_map<std::uint32_t, Entry*> first_of_;
};

}  // namespace gimnet::hub
