#pragma once

#include <cstdint>
#include <vector>

#include "base/check.hpp"
#include "hub/data/egress/run.hpp"
#include "hub/data/fanout/fanout.hpp"
#include "hub/data/fanout/paced_subscription.hpp"
#include "proto/frame/flow.hpp"

namespace gimnet::hub {

/// The starts of the last frames of a run. All starts are looked for when the first subscription
/// asks for more than one frame, once for all subscriptions. Thread safety: one shard. Memory: 4
/// bytes for each frame of the longest run.
class LastFrames {
 public:
  /// The next run, of which the last frame has `last_bytes`. Valid until: the run's bytes go, or
  /// the next call.
  void begin(const Run& run, std::uint32_t last_bytes) {
    bytes_ = run.bytes;
    size_ = run.size;
    last_bytes_ = last_bytes;
    starts_.clear();
  }
  /// Bytes of the last `frames` frames. REQUIRES: 0 < frames; the run has so many.
  [[nodiscard]] std::uint32_t bytes_of(std::uint32_t frames) {
    if (frames == 1) return last_bytes_;
    if (starts_.empty()) find();
    GIMNET_ASSERT(frames <= starts_.size());
    return size_ - starts_[starts_.size() - frames];
  }

 private:
  void find() {
    for (std::uint32_t start = 0; start != size_;) {
      starts_.push_back(start);
      start += static_cast<std::uint32_t>(proto::load_header(bytes_ + start).frame_size());
    }
  }

  const std::byte* bytes_ = nullptr;
  std::uint32_t size_ = 0;
  std::uint32_t last_bytes_ = 0;
  std::vector<std::uint32_t> starts_;  ///< ascending; empty: nobody asked
};

/// Gives the recipients of a shard no more of a group than their subscriptions allow: a window of
/// messages that they have not credited, a time between two, the newest ones held. What is held
/// ends like everything else: delivered, or in the drop book. A subscription that is not paced
/// never comes here. Thread safety: one shard. Ownership: none; books belong to their recipients,
/// which are forgotten before they go.
class Pacer {
 public:
  explicit Pacer(Fanout& fanout) : fanout_(fanout), context_(fanout.context()) {}

  /// A subscription begins, or has new terms. Returns it. `was_plain`: the recipient got everything
  /// until it began, so that it has the beginning of what is just coming.
  PacedSubscription& subscribe(Recipient& recipient, GroupId group, const PaceTerms& terms,
                               bool was_plain = false, std::uint8_t number = 0);
  /// Its counts begin at 0 under that number, with what is written from now on. Nothing if there is
  /// no such subscription.
  void begin_counts(Recipient& recipient, GroupId group, std::uint8_t number);
  /// It ends, and its counts with it.
  void unsubscribe(Recipient& recipient, GroupId group);
  /// nullptr if the recipient has none that is paced.
  [[nodiscard]] static PacedSubscription* find(const Recipient& recipient, GroupId group);

  /// The next run is offered to subscriptions. Its last frame has `last_bytes`.
  void begin_run(const Run& run, std::uint32_t last_bytes) { last_frames_.begin(run, last_bytes); }
  /// That run, or a single frame. False: it is not for this subscriber. REQUIRES: as
  /// Outbox::push().
  [[nodiscard]] bool offer(PacedSubscription& subscription, const Run& run,
                           const proto::FrameHeader& header, Handover handover);
  /// The recipient says how many messages of the group it took. False: it has no such subscription,
  /// or the total cannot be. Of former counts it changes nothing.
  [[nodiscard]] bool on_credit(const Recipient& recipient, const proto::flow::Credit& credit);

  /// Something of the outbox of a link was written. REQUIRES: recipient.paced.
  void on_written(Recipient& recipient) {
    recipient.paced->for_each([&](PacedSubscription& each) {
      if (look_at_queue(each)) release(each);
    });
  }
  /// The recipient's counts begin anew; what still waits in its outbox will be written.
  void on_new_epoch(Recipient& recipient);
  /// The recipient lost its connection, and nothing waits for it.
  void on_away(Recipient& recipient);
  /// The recipient goes.
  void forget(Recipient& recipient);

  /// Lets go what is due by now, and what has room since something was lost. Once a turn.
  void release_due();
  /// When release_due() has something to do: 0 at once, kNever nothing waits. In ms, monotonic.
  static constexpr std::uint64_t kNever = UINT64_MAX;
  [[nodiscard]] std::uint64_t next_due_ms() const;

 private:
  using Open = PacedSubscription::Open;

  [[nodiscard]] std::uint64_t now_us() const { return context_.now_ms * 1000; }
  /// The budget against which what is held for it counts.
  [[nodiscard]] BudgetLease& budget(const PacedSubscription& subscription) {
    return subscription.recipient().outbox.budget(context_);
  }
  void offer_plain(PacedSubscription& subscription, const Run& run,
                   const proto::FrameHeader& header, Handover handover);
  /// Frames that may not begin. REQUIRES: there are some.
  void hold_newest(PacedSubscription& subscription, Run rest, std::size_t lane, Handover handover);
  void offer_fragment(PacedSubscription& subscription, const Run& run,
                      const proto::FrameHeader& header, Handover handover);
  void begin_plain(PacedSubscription& subscription) const;
  /// A link's window that is full is full of what its outbox has not written. True: it was.
  static bool look_at_queue(PacedSubscription& subscription) {
    if (!subscription.by_queue || subscription.space() != 0) return false;
    Outbox& outbox = subscription.recipient().outbox;
    subscription.begin_counts(subscription.number(), outbox.waiting_messages(subscription.group()));
    return true;
  }
  void follow_source(PacedSubscription& subscription, NodeId source);
  void give_up_stalled(PacedSubscription& subscription);
  void begin_message(PacedSubscription& subscription, Open& open, std::uint32_t number);
  void end_message(PacedSubscription& subscription, Open& open);
  /// A message that will not end: what is kept of it goes.
  void abandon(PacedSubscription& subscription, Open& open, proto::DropReason reason);
  void pass(PacedSubscription& subscription, const Run& run, std::uint32_t ended,
            const proto::FrameHeader& header, Handover handover);
  [[nodiscard]] bool make_share(PacedSubscription& subscription, std::uint64_t bytes);
  void keep(PacedSubscription& subscription, KeptMessage& message, const Run& frame,
            Handover handover);
  void uncount(PacedSubscription& subscription, const KeptMessage& message);
  void hold(PacedSubscription& subscription, KeptMessage& message, std::size_t lane);
  void drop_oldest(PacedSubscription& subscription, proto::DropReason reason);
  void drop_held(PacedSubscription& subscription, proto::DropReason reason);
  void drop(PacedSubscription& subscription, const KeptMessage& message, proto::DropReason reason);
  void drop(PacedSubscription& subscription, const Run& run, proto::DropReason reason);
  void release(PacedSubscription& subscription);
  void release_oldest(PacedSubscription& subscription);
  [[nodiscard]] bool release_open(PacedSubscription& subscription);
  void write_kept(PacedSubscription& subscription, const KeptMessage& message);
  /// A subscription that something is held for, and when that was due as it was put here. It may
  /// have gone since, with a message that came at that time; then the next is due later, which is
  /// found out here at the time.
  struct Scheduled {
    std::uint64_t due_us = 0;
    PacedSubscription* subscription = nullptr;
  };
  [[nodiscard]] static bool is_later(const Scheduled& a, const Scheduled& b) {
    return a.due_us > b.due_us;
  }
  void schedule(PacedSubscription& subscription);
  void unschedule(PacedSubscription& subscription);

  Fanout& fanout_;
  EgressContext& context_;
  std::vector<PacedSubscription*> ripe_;
  std::vector<PacedSubscription*> ripe_now_;
  std::vector<Scheduled> scheduled_;  ///< a heap, the next one first
  KeptMessage scratch_;
  LastFrames last_frames_;  ///< of the run that is offered
};

}  // namespace gimnet::hub
