#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <type_traits>
#include <vector>

#include "base/ids.hpp"
#include "hub/concurrent/mpsc_queue.hpp"
#include "hub/concurrent/waker.hpp"
#include "hub/data/buffer.hpp"
#include "hub/data/ring_queue.hpp"
#include "hub/data/tables/node_table.hpp"
#include "hub/limits.hpp"

namespace gimnet::hub {

enum class MailKind : std::uint8_t {
  frames,   ///< admitted frames, to be routed to recipients on the receiving shard
  control,  ///< one whole frame of FLOW or REPORT in `small`, for the node
  hold,     ///< stop reading the node until as many `release`
  release,
  start_wanted,  ///< a subscriber of a retained group wants to begin: `small` is a GroupStart
  start,  ///< it begins here: what came before in this mailbox is not for it, what comes after is
  retained,  ///< frames of the last message, for that one subscriber
  last,      ///< the sending shard drains and hands over nothing more: `small` is its ShardIndex
};

/// A subscriber that begins with the last message of a group (RetainedMessages).
struct GroupStart {
  GroupId group;
  ConnectionSlot slot;
  std::uint32_t generation = 0;
  std::uint32_t ticket = 0;  ///< numbers the starts that its shard asked for
  ShardIndex shard;
  NodeId provider;  ///< whose shard was asked
};

/// An entry that one shard hands to another: a stretch of a slab with whole frames, once per burst,
/// or a word about a sender.
struct Mail {
  MailKind kind = MailKind::frames;
  std::uint8_t small_size = 0;
  std::uint32_t size = 0;
  std::uint32_t frames = 0;
  NodeId node;
  Buffer* lent = nullptr;  ///< the loan that goes with the bytes (BufferPool::lend)
  const std::byte* bytes = nullptr;
  std::byte small[72];

  /// Of frames: how many those to many may come to at the receiver. In `small`, where there are
  /// any.
  [[nodiscard]] std::uint32_t deliveries() const {
    if (kind != MailKind::frames || small_size == 0) return 0;
    std::uint32_t count = 0;
    std::memcpy(&count, small, sizeof count);
    return count;
  }
  /// REQUIRES: frames, more than 0.
  void set_deliveries(std::uint32_t count) {
    small_size = sizeof count;
    std::memcpy(small, &count, sizeof count);
  }
};

/// The queues into one shard, one per sending shard as far as order and bounds go. It never makes a
/// shard wait: the sender asks full() and crowded() first. Thread safety: post() and what a sender
/// asks only from that sender's thread; drain() from the receiver's.
class Mailbox {
 public:
  struct Bounds {
    std::uint64_t entries;
    std::uint64_t bytes;
    std::uint64_t deliveries = ~std::uint64_t{0};  ///< makes it crowded, never full
  };
  /// So many shares of a turn (turn_deliveries) may wait between two shards before their senders
  /// are not read.
  static constexpr std::uint64_t kWaitingShares = 4;
  [[nodiscard]] static Bounds bounds_from(const Limits& limits) {
    // crowded() begins at half of each
    return {limits.mailbox_entries, limits.mailbox_bytes,
            2 * kWaitingShares * limits.turn_deliveries};
  }
  Mailbox(std::size_t shards, Bounds bounds, Waker& waker);

  /// Sender: no room for another entry of that many bytes.
  [[nodiscard]] bool full(ShardIndex from, std::uint32_t bytes) const;
  /// Sender: more than half full. If so, room() will be told once it is not.
  [[nodiscard]] bool crowded(ShardIndex from);
  /// Sender: returns whether the receiver had to be woken. Frames are only posted if not full();
  /// words always are.
  bool post(ShardIndex from, Mail mail);
  /// The same for frames to many. REQUIRES: mail.deliveries() != 0.
  bool post_to_many(ShardIndex from, const Mail& mail) {
    pairs_[from.value()].sent_deliveries += mail.deliveries();
    return post(from, mail);
  }

  /// Receiver: calls take(const Mail&) for up to `most` entries, until it returns false for one if
  /// it returns anything, and before_taking() once for every few of them that were fetched; returns
  /// how many.
  template <class Before, class Take>
  std::size_t drain(std::size_t most, Before&& before_taking, Take&& take);
  /// Receiver: nothing waits.
  [[nodiscard]] bool empty() const { return fetched_.empty() && queue_.empty(); }
  /// Receiver: senders that found it crowded and now may go on; each once.
  template <class Tell>
  void tell_room(Tell&& tell);

 private:
  struct Letter {
    std::uint8_t from = 0;
    Mail mail;
  };
  /// The queue between one sender and this receiver; each half lies on its own cache line.
  struct Pair {
    // The sender's
    alignas(64) std::uint64_t sent_entries = 0;
    std::uint64_t sent_bytes = 0;
    std::uint64_t sent_deliveries = 0;
    // Written by the receiver, read by the sender
    alignas(64) std::atomic<std::uint64_t> taken_entries{0};
    std::atomic<std::uint64_t> taken_bytes{0};
    std::atomic<std::uint64_t> taken_deliveries{0};
    // Set by the sender, cleared by the receiver
    alignas(64) std::atomic<bool> sender_waits{false};
  };
  static void on_taken(Pair& pair, const Mail& mail) {
    // relaxed: counts for a bound; only the receiver writes them, and the sender may see them late.
    pair.taken_entries.store(pair.taken_entries.load(std::memory_order_relaxed) + 1,
                             std::memory_order_relaxed);
    // relaxed: as above
    pair.taken_bytes.store(pair.taken_bytes.load(std::memory_order_relaxed) + mail.size,
                           std::memory_order_relaxed);
    if (mail.small_size == 0) return;
    // relaxed: as above
    const std::uint64_t deliveries =
        pair.taken_deliveries.load(std::memory_order_relaxed) + mail.deliveries();
    pair.taken_deliveries.store(deliveries, std::memory_order_relaxed);  // relaxed: as above
  }
  /// The answer of `take`: go on?
  template <class Take>
  [[nodiscard]] bool take_one(const Letter& letter, Take& take);
  [[nodiscard]] static bool over(const Pair& pair, std::uint64_t entries, std::uint64_t bytes);
  [[nodiscard]] bool over_half(const Pair& pair) const;
  /// Entries that are fetched at a time.
  static constexpr std::size_t kBatch = 32;

  const Bounds bounds_;
  Waker& waker_;
  MpscQueue<Letter> queue_;
  RingQueue<Letter> fetched_;  ///< and not taken yet; the receiver's. Limit: kBatch
  std::unique_ptr<Pair[]> pairs_;
  const std::size_t shards_;
};

template <class Before, class Take>
std::size_t Mailbox::drain(std::size_t most, Before&& before_taking, Take&& take) {
  std::size_t taken = 0;
  bool goes_on = true;
  if (!fetched_.empty()) before_taking();
  for (; !fetched_.empty() && goes_on && taken < most; ++taken) {
    goes_on = take_one(fetched_.front(), take);
    fetched_.pop_front();
  }
  while (goes_on && taken < most) {
    const std::size_t batch = std::min(most - taken, kBatch);
    const std::size_t fetched = queue_.drain(batch, before_taking, [&](Letter&& letter) {
      if (goes_on) {
        goes_on = take_one(letter, take);
      } else {
        fetched_.push_back(letter);
      }
    });
    taken += fetched - fetched_.size();
    if (fetched < batch) break;
  }
  return taken;
}

template <class Take>
bool Mailbox::take_one(const Letter& letter, Take& take) {
  if constexpr (std::is_void_v<std::invoke_result_t<Take&, const Mail&>>) {
    take(letter.mail);
    on_taken(pairs_[letter.from], letter.mail);
    return true;
  } else {
    const bool goes_on = take(letter.mail);
    on_taken(pairs_[letter.from], letter.mail);
    return goes_on;
  }
}

template <class Tell>
void Mailbox::tell_room(Tell&& tell) {
  // The fence's partner is the one in crowded(): either the sender saw the room, or this thread
  // sees that it waits.
  std::atomic_thread_fence(std::memory_order_seq_cst);
  for (std::size_t from = 0; from < shards_; ++from) {
    Pair& pair = pairs_[from];
    // relaxed: ordered by the fence
    if (!pair.sender_waits.load(std::memory_order_relaxed)) continue;
    if (pair.sender_waits.exchange(false,
                                   std::memory_order_relaxed)) {  // relaxed: ordered by the fence
      tell(ShardIndex{static_cast<std::uint8_t>(from)});
    }
  }
}

}  // namespace gimnet::hub
