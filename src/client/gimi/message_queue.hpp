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

/// Received messages of one key or subscription: a ring buffer, or one that refuses when it is
/// full. Thread safety: guarded by the mutex of its Inbox, through which programs come to it.
class MessageQueue {
 public:
  MessageQueue(Inbox& inbox, const QueueOptions& options, std::size_t bytes_max)
      : inbox_(inbox), bytes_max_(bytes_max) {
    set(options);
  }

  void set(const QueueOptions& options);
  void resize(std::size_t messages) { set({messages, options_.at_full}); }

  /// It would refuse. A message fits into an empty queue, whatever its size.
  [[nodiscard]] bool refuses() const;
  /// REQUIRES: !refuses(). `arrival` counts the messages of all queues of an Inbox.
  void push(Message message, std::uint64_t arrival);
  [[nodiscard]] std::optional<Message> pop();
  [[nodiscard]] std::optional<Message> pop_newest();
  /// The oldest one counts as overwritten. Returns its bytes. REQUIRES: !empty().
  std::size_t overwrite_oldest();

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
  void make_room(std::size_t messages);
  void count_taken(const Message& message);

  struct Entry {
    Message message;
    std::uint64_t arrival;
  };

  Inbox& inbox_;
  const std::size_t bytes_max_;
  QueueOptions options_;
  std::deque<Entry> entries_;  ///< Limit: bytes_max_ and the options' messages
  std::vector<TakenMessages> taken_;
  std::size_t bytes_ = 0;
  std::uint64_t received_ = 0;
  std::uint64_t overwritten_ = 0;
  Timeout silence_{0};
  std::int64_t silent_at_ns_ = INT64_MAX;
  Condition filled_;
  WaitSource source_;
};

}  // namespace gimnet::gimi
