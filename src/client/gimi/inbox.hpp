#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "base/mutex.hpp"
#include "client/gimi/ending.hpp"
#include "client/gimi/growing_queues.hpp"
#include "client/gimi/message_queue.hpp"
#include "gimnet/gimi/outcome.hpp"

namespace gimnet::gimi {

/// Told that a message found its place, before anybody can take it out again. Called with the inbox
/// locked.
class Receipt {
 public:
  virtual void on_kept() = 0;

 protected:
  ~Receipt() = default;
};

/// All queues of a node. Thread safety: any thread. Queues live as long as the inbox, but for those
/// of subscriptions.
class Inbox {
 public:
  /// Keys for which nobody asked that have a queue. Beyond it an empty one goes, or that of which
  /// a message waits longest.
  static constexpr std::size_t kUnaskedKeysMax = 1024;
  /// Bytes that wait in their queues together, as many as the largest message has by default: a
  /// program that never looks there does not grow, whatever strangers send it.
  static constexpr std::size_t kUnaskedBytesMax = std::size_t{64} << 20;
  /// The hub takes what a subscription missed once in that time.
  static constexpr Timeout kMissedPeriod{1000};

  /// Called without a lock. `more`: others wait in the same queue.
  using OnTaken = std::function<void(const TakenMessages& taken, bool more)>;
  /// `begin` is called, maybe with locks, as tick() has to be called: for a paced queue, or once
  /// when messages were missed; then `tell` without a lock, from tick(), at most once a second.
  struct Missing {
    std::function<void()> begin;
    std::function<void()> tell;
  };
  /// `on_room` is called without a lock when a queue that refused has room again; `on_taken` with
  /// what went out of a queue and counts in a window.
  Inbox(std::size_t unasked_messages, std::size_t bytes_max, std::function<void()> on_room,
        OnTaken on_taken = {}, Missing missing = {})
      : unasked_messages_(unasked_messages),
        bytes_max_(bytes_max),
        on_room_(std::move(on_room)),
        on_taken_(std::move(on_taken)),
        missing_(std::move(missing)) {}

  /// The queue of a key, made if there is none; with `options` changed to them.
  MessageQueue& queue(MessageKey key, const QueueOptions* options) GIMNET_EXCLUDES(mutex_);
  /// A queue for a subscription, until remove(). `silence`: as in SubscribeOptions.
  MessageQueue& add_queue(const QueueTerms& terms, Timeout silence = Timeout{0})
      GIMNET_EXCLUDES(mutex_);
  /// At most so many messages a second come into a queue that add_queue() made, the newest at each
  /// due time; 0: all that come.
  void pace(MessageQueue& queue, double rate_hz) GIMNET_EXCLUDES(mutex_);
  /// Its messages count as taken. REQUIRES: add_queue() made it, and nobody uses it any more.
  void remove(MessageQueue& queue) GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] std::size_t queues() GIMNET_EXCLUDES(mutex_);

  /// False: no room, the message is unchanged; on_room() will be called. `receipt` may be null.
  [[nodiscard]] bool put(MessageQueue& queue, Message& message, Receipt* receipt)
      GIMNET_EXCLUDES(mutex_);
  /// As put() to each of several queues, or to none. The message counts as taken then.
  [[nodiscard]] bool put_in_all(std::span<MessageQueue* const> queues, Message& message)
      GIMNET_EXCLUDES(mutex_);
  /// As put() to the queue of the key. Where nobody asked for the key, older messages of such keys
  /// may go for it.
  [[nodiscard]] bool put(MessageKey key, Message& message, Receipt* receipt)
      GIMNET_EXCLUDES(mutex_);
  /// A WaitSet waits for a message here: of that queue, or of any.
  /// True: tick() has to be called.
  [[nodiscard]] bool visit(MessageQueue& queue, const SourceVisitor& visitor)
      GIMNET_EXCLUDES(mutex_);
  void visit_any(const SourceVisitor& visitor) GIMNET_EXCLUDES(mutex_);
  /// A subscription missed messages, or one of its queues was full.
  void note_missed() {
    // relaxed: the counts are read under their own locks
    if (missing_.begin && !missed_.exchange(true, std::memory_order_relaxed)) missing_.begin();
  }
  /// Tells wait sets of queues that are silent, and what was missed; gives paced queues what is
  /// due. False: nothing is left to tell at a later time.
  [[nodiscard]] bool tick() GIMNET_EXCLUDES(mutex_);
  /// tick() has to be called then for a paced queue; INT64_MAX: for none.
  [[nodiscard]] std::int64_t due_ns() const {
    // relaxed: `begin` is called after each change, and what it does is seen with it
    return due_ns_.load(std::memory_order_relaxed);
  }
  void count_dropped() GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] std::uint64_t dropped() GIMNET_EXCLUDES(mutex_);

  /// Status::silence: nothing came for the time that add_queue() was told.
  /// `left`: set by leave(), in which case the answer is `closed`; null: nobody calls that.
  [[nodiscard]] Outcome<Message> receive(MessageQueue& queue, Timeout timeout,
                                         const std::atomic<bool>* left = nullptr)
      GIMNET_EXCLUDES(mutex_);
  /// Sets `left` and has those that receive with it leave.
  void leave(MessageQueue& queue, std::atomic<bool>& left) GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] Outcome<Message> receive_any(Timeout timeout) GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] std::optional<Message> try_receive(MessageQueue& queue) GIMNET_EXCLUDES(mutex_) {
    return take(queue, false);
  }
  [[nodiscard]] std::optional<Message> take_newest(MessageQueue& queue) GIMNET_EXCLUDES(mutex_) {
    return take(queue, true);
  }
  void set(MessageQueue& queue, const QueueTerms& terms) GIMNET_EXCLUDES(mutex_);
  void resize(MessageQueue& queue, std::size_t messages) GIMNET_EXCLUDES(mutex_);

  struct Counts {
    std::size_t size = 0;
    std::uint64_t received = 0;
    std::uint64_t overwritten = 0;
    std::uint64_t left_out = 0;  ///< of a paced queue, for newer ones
  };
  [[nodiscard]] Counts counts(MessageQueue& queue) GIMNET_EXCLUDES(mutex_);

  /// Nothing more comes: when they are empty, queues answer so.
  void end(const Ending& ending) GIMNET_EXCLUDES(mutex_);

 private:
  /// `newest`: the others count as taken.
  [[nodiscard]] std::optional<Message> take(MessageQueue& queue, bool newest)
      GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] bool push(MessageQueue& queue, Message& message, Receipt* receipt)
      GIMNET_REQUIRES(mutex_);
  void push_now(MessageQueue& queue, Message message) GIMNET_REQUIRES(mutex_);
  /// The message that a paced queue holds comes in, if it is due.
  void give_due(MessageQueue& queue, std::int64_t now_ns) GIMNET_REQUIRES(mutex_);
  /// Finds the next due time of all paced queues.
  void set_due() GIMNET_REQUIRES(mutex_);
  [[nodiscard]] MessageQueue* first_waiting() GIMNET_REQUIRES(mutex_);
  /// After each change of what waits in a queue: it may have become empty, or is so no longer.
  void recount(MessageQueue& queue) GIMNET_REQUIRES(mutex_) {
    if (queue.counted == queue.empty()) count(queue, !queue.empty());
  }
  void count(MessageQueue& queue, bool filled) GIMNET_REQUIRES(mutex_);
  /// True: a queue of a wait set expects messages.
  [[nodiscard]] bool look_at_silence() GIMNET_REQUIRES(mutex_);
  /// Makes room for another key. REQUIRES: there are kUnaskedKeysMax.
  void forget_unasked() GIMNET_REQUIRES(mutex_);
  /// Overwrites the oldest messages beyond kUnaskedBytesMax; the newest one stays.
  void bound_unasked() GIMNET_REQUIRES(mutex_);
  [[nodiscard]] bool is_room_wanted(const MessageQueue& queue) GIMNET_REQUIRES(mutex_);
  /// The news that a change of a queue leaves, to be told without the lock.
  struct News {
    bool room = false;
    bool more = false;
    std::vector<TakenMessages> taken;
  };
  [[nodiscard]] News news_of(MessageQueue& queue) GIMNET_REQUIRES(mutex_);
  void tell(const News& news) const GIMNET_EXCLUDES(mutex_);

  const std::size_t unasked_messages_;
  const std::size_t bytes_max_;
  const std::function<void()> on_room_;
  const OnTaken on_taken_;
  const Missing missing_;
  std::atomic<bool> missed_{false};  ///< and not told yet
  std::atomic<std::int64_t> due_ns_{INT64_MAX};

  Mutex mutex_;
  Condition any_;
  WaitSource any_source_ GIMNET_GUARDED_BY(mutex_);
  std::size_t filled_ GIMNET_GUARDED_BY(mutex_) = 0;  ///< queues with messages
  /// Limit: the queues that the program asked for, and kUnaskedKeysMax
  std::list<MessageQueue> queues_ GIMNET_GUARDED_BY(mutex_);
  std::map<MessageKey, MessageQueue*> by_key_ GIMNET_GUARDED_BY(mutex_);
  /// Those of keys for which nobody asked. Limit: kUnaskedKeysMax
  std::vector<MessageQueue*> unasked_ GIMNET_GUARDED_BY(mutex_);
  std::vector<MessageQueue*> paced_ GIMNET_GUARDED_BY(mutex_);  ///< Limit: all that are there
  GrowingQueues growing_ GIMNET_GUARDED_BY(mutex_);
  std::size_t any_waiters_ GIMNET_GUARDED_BY(mutex_) = 0;
  MessageQueue* refusing_ GIMNET_GUARDED_BY(mutex_) =
      nullptr;  ///< at most one: nothing comes while one refuses
  std::uint64_t arrivals_ GIMNET_GUARDED_BY(mutex_) = 0;
  std::uint64_t dropped_ GIMNET_GUARDED_BY(mutex_) = 0;
  std::int64_t missed_due_ns_ GIMNET_GUARDED_BY(mutex_) = 0;  ///< may be told then; steady
  Ending end_ GIMNET_GUARDED_BY(mutex_);
};

}  // namespace gimnet::gimi
