#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <utility>

#include "hub/data/egress/entry.hpp"
#include "hub/data/egress/source_bytes.hpp"
#include "hub/data/flat_map.hpp"
#include "hub/data/ring_queue.hpp"

namespace gimnet::hub {

/// The identity of a stream of LATEST messages within its lane: src, dst, kind, key.
struct LatestStream {
  std::uint64_t addresses = 0;
  std::uint64_t key = 0;
  std::uint16_t kind_and_keyed = 0;
  friend bool operator==(const LatestStream&, const LatestStream&) = default;
};
[[nodiscard]] std::size_t hash_value(const LatestStream& stream);

/// One lane of an outbox: entries in order, found again by stream (to replace an older LATEST
/// message) and by message (to add a fragment). Both are found in constant time, however many wait,
/// through indexes that are made when they are needed. What leaves it by being dropped or replaced
/// is handed to a `lose(Entry&, reason)`. Thread safety: one shard.
class LaneQueue {
 public:
  [[nodiscard]] bool empty() const { return entries_.empty(); }
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }
  /// The same with the memory of the entries, those included that were dropped and have not left
  /// their place: many small messages take more for their entries than for their bytes.
  [[nodiscard]] std::uint64_t held_bytes() const {
    return bytes_ + entries_.size() * sizeof(Entry);
  }
  /// Bytes of entries that must not be dropped for room.
  [[nodiscard]] std::uint64_t block_bytes() const { return block_bytes_; }
  /// Has the sender less than its equal share of the half that BLOCK has in a lane of `bytes_max`,
  /// with so many bytes more? Then it is let in, though others fill the lane: those who refill it
  /// first would have all of it.
  [[nodiscard]] bool is_within_share(NodeId sender, std::uint32_t bytes, std::uint64_t bytes_max) {
    return sources().fixed(SourceBytes::place_of(sender)) + bytes <= block_share(bytes_max);
  }
  /// The senders that need not pause any more, as bits of their places in SourceBytes: all once
  /// half of their bytes went, or those that have half of their share.
  [[nodiscard]] std::uint32_t places_with_room(std::uint64_t bytes_max) {
    return sources().below(block_bytes_ <= bytes_max / 4 ? UINT64_MAX : block_share(bytes_max) / 2);
  }
  /// Bytes that still fit in a lane of `bytes_max`: of messages sent with BLOCK into half of it, of
  /// others into what those leave, at least the other half.
  [[nodiscard]] std::uint64_t room(bool block, std::uint64_t bytes_max) const {
    const std::uint64_t half = bytes_max / 2;
    if (block) return half - std::min(half, block_bytes_);
    const std::uint64_t share = bytes_max - std::min(half, block_bytes_);
    return share - std::min(share, bytes_ - block_bytes_);
  }
  /// Do so many bytes more fit in a lane of `bytes_max`, whatever of it is sent with BLOCK? Most
  /// often they do, and room() needs not be asked.
  [[nodiscard]] bool surely_fits(std::uint64_t bytes, std::uint64_t bytes_max) const {
    return bytes_ + bytes <= bytes_max / 2;
  }
  /// Messages of that group of which the end waits.
  [[nodiscard]] std::uint64_t messages_of(GroupId group);
  /// Does a message wait of which nothing was written yet? The others are finished whatever
  /// happens.
  [[nodiscard]] bool holds_whole() const { return bytes_ != touched_bytes_; }
  /// A fragment of the entry was written; the caller has taken it out of its size.
  void touch(Entry& entry) {
    if (!entry.fragmented || entry.touched) return;
    entry.touched = true;
    touched_bytes_ += entry.size;
    if (entry.block || !counts_sources_) return;
    sources_.take(entry.source, entry.size);
    entry.source += SourceBytes::kFixed;
    sources_.add(entry.source, entry.size);
  }
  /// Bytes of entries that a newer message may replace.
  [[nodiscard]] std::uint64_t latest_bytes() const { return latest_bytes_; }

  /// Adds the entry, or joins it to the last one where both are plain runs of the same header in
  /// neighbouring memory, and not too much to be dropped at a time.
  void push(Entry&& entry);
  /// Counts more frames into the last entry, behind which the caller has put them. REQUIRES: it is
  /// plain, of one piece, and they have its header.
  void extend(Entry& last, std::uint32_t bytes, std::uint32_t frames) {
    last.run.size += bytes;
    last.run.frames += frames;
    last.size += bytes;
    last.frames += frames;
    bytes_ += bytes;
    if (counts_sources_) sources_.add(last.source, bytes);
    if (last.block) block_bytes_ += bytes;
  }
  /// The entry that still waits for more fragments of that message, or nullptr.
  [[nodiscard]] Entry* find_message(NodeId src, std::uint32_t message_number);
  void append_fragment(Entry& entry, Run fragment, bool last, PiecePool& pool);

  /// Puts `entry`, a LATEST message, in the place of an untouched older one of its stream, which is
  /// moved to `older`. Returns whether there was one. From the first call on, LATEST entries are
  /// looked up by stream.
  [[nodiscard]] bool replace_latest(Entry& entry, Entry& older);

  /// Does the same for all that came while nobody asked for it: of each stream only the newest
  /// LATEST message stays, in the place of the oldest. Calls lose(Entry& older) for each that goes.
  /// The entries get other numbers.
  template <class Lose>
  void replace_all_latest(Lose&& lose);

  /// Waiting bytes by source. Counted from the first call on until the lane is empty, since most
  /// lanes are never full.
  [[nodiscard]] SourceBytes& sources() {
    if (!counts_sources_) count_sources();
    return sources_;
  }
  /// Fills in the place at which the entry counts. REQUIRES: it is not empty.
  static void note_source(Entry& entry) {
    entry.source = SourceBytes::place_of(NodeId{entry.run.header().src});
    if (entry.block || entry.touched) entry.source += SourceBytes::kFixed;
  }
  /// The node that sent what counts at that place, as the first entries show it; 0: none of them.
  [[nodiscard]] NodeId source_at(std::uint8_t place);

  /// Takes out the oldest entry that may be dropped for room of the source sources().loser(). If
  /// none of the first 64 is of that source, it takes the oldest one that may be dropped. Returns
  /// false if nothing may be dropped.
  [[nodiscard]] bool drop_oldest(Entry& dropped);

  /// Takes out the entries for which which(const Entry&) is true, and calls lose(Entry&) for each.
  template <class Which, class Lose>
  void lose_all(Which&& which, Lose&& lose);
  /// Calls settle(Entry&) for those that came since the last call, and again for the newest of
  /// then, which may have grown.
  template <class Settle>
  void settle(Settle&& settle);

  /// The oldest entry that is neither dropped nor replaced. REQUIRES: there is one.
  [[nodiscard]] Entry& front();
  /// The front entry's first frame, or first piece, has left: keeps the sums right. The entry
  /// itself is changed by the caller.
  void on_left(const Entry& entry, std::uint32_t bytes);
  void pop_front();

  [[nodiscard]] RingQueue<Entry>& entries() { return entries_; }
  /// Memory that the lane itself takes, entries and indexes, whatever they refer to.
  [[nodiscard]] std::size_t capacity_bytes() const;
  /// Streams that are remembered.
  [[nodiscard]] std::size_t streams() const { return streams_ ? streams_->size() : 0; }
  /// Nothing came for a while: gives back memory that only a busy lane needs.
  void trim();

 private:
  [[nodiscard]] std::uint64_t block_share(std::uint64_t bytes_max) {
    return bytes_max / 2 / sources().fixed_sources();
  }
  using StreamIndex = FlatMap<LatestStream, std::uint64_t>;
  using MessageIndex = FlatMap<std::uint64_t, std::uint64_t>;  ///< sender and message to entry
  /// A message among more entries than these is looked up; among fewer, looking through them is
  /// cheaper.
  static constexpr std::size_t kSearchMax = 64;

  [[nodiscard]] static LatestStream stream_of(const Entry& entry);
  /// REQUIRES: oldest_hint_ is the oldest entry that may be dropped.
  [[nodiscard]] std::uint64_t find_oldest_of(std::uint8_t place);
  void close_gap(std::uint64_t number);
  void count_sources();
  void count(const Entry& entry);
  void discount(const Entry& entry);
  void skip_dead();
  void forget_streams();
  void begin_streams();
  [[nodiscard]] Entry* search_message(NodeId src, std::uint32_t message_number);
  void index_messages();
  void note_message(const Entry& entry, std::uint64_t number);
  void forget_messages();

  RingQueue<Entry> entries_;
  std::uint64_t bytes_ = 0;
  std::uint64_t block_bytes_ = 0;
  std::uint64_t latest_bytes_ = 0;
  std::uint64_t touched_bytes_ = 0;
  std::uint64_t settled_ = 0;    ///< entries below this number are settled
  bool counts_sources_ = false;  ///< sources_ has all that waits
  SourceBytes sources_;
  std::uint64_t oldest_hint_ = 0;  ///< no droppable entry has a lower number
  bool indexed_ = false;           ///< streams_ names every LATEST entry that waits
  std::unique_ptr<StreamIndex> streams_;
  bool messages_indexed_ = false;  ///< messages_ names every message that waits for more
  std::unique_ptr<MessageIndex> messages_;
};

template <class Lose>
void LaneQueue::replace_all_latest(Lose&& lose) {
  begin_streams();
  for (std::size_t left = entries_.size(); left != 0; --left) {
    Entry entry = std::move(entries_.front());
    entries_.pop_front();  // before another is pushed, so that the ring does not grow
    if (entry.frames == 0) continue;
    discount(entry);
    Entry older;
    if (entry.latest && !entry.touched && replace_latest(entry, older)) {
      lose(older);
    } else {
      push(std::move(entry));
    }
  }
}

template <class Which, class Lose>
void LaneQueue::lose_all(Which&& which, Lose&& lose) {
  for (std::uint64_t number = entries_.first_number(); number != entries_.end_number(); ++number) {
    Entry& entry = entries_.at(number);
    if (entry.frames == 0 || !which(std::as_const(entry))) continue;
    on_left(entry, entry.size);
    lose(entry);
  }
  skip_dead();
}

template <class Settle>
void LaneQueue::settle(Settle&& settle) {
  settled_ = std::max(settled_, entries_.first_number());
  for (; settled_ < entries_.end_number(); ++settled_) {
    Entry& entry = entries_.at(settled_);
    if (entry.frames != 0) settle(entry);
    // The last entry may grow until the next turn: it is looked at again then.
    if (settled_ + 1 == entries_.end_number()) break;
  }
}

}  // namespace gimnet::hub
