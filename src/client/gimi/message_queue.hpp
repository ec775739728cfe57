#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <utility>
#include <vector>

#include "base/mutex.hpp"
#include "client/gimi/wait_set.hpp"
#include "gimnet/gimi/message.hpp"
#include "gimnet/gimi/options.hpp"

namespace gimnet::gimi {

class Inbox;

/// Messages of a group that went out of a queue, and count in a window.
struct TakenMessages {
  std::uint32_t group = 0;
  std::uint32_t epoch = 0;
  std::uint32_t count = 0;
};

/// The room of a queue.
struct QueueTerms {
  QueueOptions options;
  /// More messages than `options` says may wait, as long as all together take at most the bytes
  /// that MessageQueue::allow() says. REQUIRES: the queue overwrites its oldest message.
  bool grows = false;
};

/// Received messages of one key or subscription: a ring buffer, or one that refuses when it is
/// full. Thread safety: guarded by the mutex of its Inbox, through which programs come to it.
class MessageQueue {
 public:
  MessageQueue(Inbox& inbox, const QueueTerms& terms, std::size_t bytes_max)
      : inbox_(inbox), bytes_max_(bytes_max) {
    set(terms);
  }

  void set(const QueueTerms& terms);
  void resize(std::size_t messages) { set({{messages, options_.at_full}}); }

  /// It may hold more messages than its options say.
  [[nodiscard]] bool grows() const { return grows_; }
  /// One that grows may take so many bytes, as cost_bytes() counts them.
  void allow(std::size_t cost_bytes_max);
  /// Memory that its messages keep: a place and their bytes each, and the slabs that they lie in.
  /// Messages behind each other in one slab share it.
  [[nodiscard]] std::size_t cost_bytes() const { return cost_bytes_; }

  /// It would refuse. A message fits into an empty queue, whatever its size. A paced one holds the
  /// newest outside and refuses nothing.
  [[nodiscard]] bool refuses() const { return !is_paced() && is_full(); }
  /// REQUIRES: !refuses(). `arrival` counts the messages of all queues of an Inbox.
  void push(Message message, std::uint64_t arrival);
  [[nodiscard]] std::optional<Message> pop();
  [[nodiscard]] std::optional<Message> pop_newest();
  /// The oldest one counts as overwritten. Returns its bytes. REQUIRES: !empty().
  std::size_t overwrite_oldest();

  /// From now on one message comes in that time at most, the newest at each due time; 0: all.
  void pace(std::int64_t period_ns, std::int64_t now_ns);
  [[nodiscard]] bool is_paced() const { return period_ns_ != 0 || held_.has_value(); }
  /// Keeps a message in place of one that is held.
  void hold(Message message);
  /// When the one that is held comes in; INT64_MAX: none is held, or there is no room.
  [[nodiscard]] std::int64_t due_ns() const { return held_ && !is_full() ? due_ns_ : INT64_MAX; }
  /// The one that is held, if any, counts as taken.
  void drop_held();
  /// The one that is held, if it is due: it comes in.
  [[nodiscard]] std::optional<Message> take_due(std::int64_t now_ns);
  /// Messages that were held and went for newer ones.
  [[nodiscard]] std::uint64_t left_out() const { return left_out_; }

  /// Messages are expected at least once in that time; 0: they are not.
  void expect(Timeout silence);
  /// When nothing will have come for that long, and nobody was told; steady; INT64_MAX: never.
  [[nodiscard]] std::int64_t silent_at_ns() const { return silent_at_ns_; }
  /// That is now, and counts as told.
  [[nodiscard]] bool tells_silence();
  [[nodiscard]] std::int64_t silence_ms() const { return silence_.count(); }

  /// The messages that left it since the last call, popped or overwritten.
  [[nodiscard]] std::vector<TakenMessages> take_taken() { return std::exchange(taken_, {}); }

  [[nodiscard]] std::size_t size() const { return entries_.size(); }
  [[nodiscard]] bool empty() const { return entries_.empty(); }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }
  /// REQUIRES: !empty().
  [[nodiscard]] std::uint64_t first_arrival() const { return entries_.front().arrival; }
  [[nodiscard]] std::uint64_t received() const { return received_; }
  [[nodiscard]] std::uint64_t overwritten() const { return overwritten_; }
  /// Half empty: time to take in again what was refused.
  [[nodiscard]] bool wants_more() const { return entries_.size() <= options_.messages / 2; }

  [[nodiscard]] Inbox& inbox() const { return inbox_; }
  [[nodiscard]] Condition& filled() { return filled_; }
  [[nodiscard]] WaitSource& source() { return source_; }
  /// Its inbox counts it among those with messages.
  bool counted = false;

 private:
  /// Bytes of a message beside its own: its place here, and what its storage takes.
  static constexpr std::size_t kPlaceBytes = 160;

  [[nodiscard]] bool is_full() const;
  /// Until so many messages are left, or, of one that grows, as many as cost so much with `more`.
  void make_room(std::size_t messages, std::size_t more_bytes);
  /// The first one is about to be taken out.
  void leave_first();
  /// The cost of a message beside its neighbour, which may be null.
  [[nodiscard]] static std::size_t cost_of(const Message& message, const Message* neighbour);
  void count_taken(const Message& message);

  struct Entry {
    Message message;
    std::uint64_t arrival;
  };

  Inbox& inbox_;
  const std::size_t bytes_max_;
  QueueOptions options_;
  bool grows_ = false;
  /// Limit: the options' messages; of one that grows also cost_bytes_max_
  std::deque<Entry> entries_;
  std::vector<TakenMessages> taken_;
  std::size_t bytes_ = 0;
  std::size_t cost_bytes_ = 0;
  std::size_t cost_bytes_max_ = 0;  ///< of one that grows
  std::uint64_t received_ = 0;
  std::uint64_t overwritten_ = 0;
  Timeout silence_{0};
  std::int64_t silent_at_ns_ = INT64_MAX;
  std::int64_t period_ns_ = 0;   ///< of a paced one
  std::int64_t due_ns_ = 0;      ///< when the next message may come in
  std::optional<Message> held_;  ///< until then
  std::uint64_t left_out_ = 0;
  Condition filled_;
  WaitSource source_;
};

}  // namespace gimnet::gimi
