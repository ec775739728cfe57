#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "proto/frame/frame_header.hpp"

namespace gimnet::hub {

/// A number that one thread changes and any thread reads. Adding costs a plain load and store, no
/// locked instruction.
class Counter {
 public:
  void add(std::uint64_t n) {
    // relaxed: only the owner writes, and readers want a recent number, not an order.
    value_.store(value_.load(std::memory_order_relaxed) + n, std::memory_order_relaxed);
  }
  /// No further than `most`: for numbers that a node only claims.
  void add_within(std::uint64_t n, std::uint64_t most) {
    const std::uint64_t now = value_.load(std::memory_order_relaxed);  // relaxed: as in add()
    store(now < most ? now + std::min(n, most - now) : now);
  }
  void subtract(std::uint64_t n) {
    // relaxed: as in add().
    value_.store(value_.load(std::memory_order_relaxed) - n, std::memory_order_relaxed);
  }
  void store(std::uint64_t n) {
    value_.store(n, std::memory_order_relaxed);  // relaxed: as in add()
  }
  void raise_to(std::uint64_t n) {
    // relaxed: as in add().
    if (n > value_.load(std::memory_order_relaxed)) value_.store(n, std::memory_order_relaxed);
  }
  // relaxed: as in add().
  [[nodiscard]] std::uint64_t value() const { return value_.load(std::memory_order_relaxed); }

 private:
  std::atomic<std::uint64_t> value_{0};
};

/// The most that gap_frames of one shard can be. A node may claim to have let go of as many frames
/// as there are numbers. Readers of the sums of all shards take them for numbers with a sign, in
/// which a larger sum would be negative.
inline constexpr std::uint64_t kGapFramesMost = std::uint64_t{1} << 56;

/// The counters of one shard. The ledger: accepted + copies = delivered + dropped + queued, per
/// frame and recipient. Thread safety: written by its shard only, read by anybody.
struct alignas(64) ShardCounters {
  // The ledger, in frames
  Counter accepted;   ///< taken from the connections of this shard
  Counter copies;     ///< recipients beyond the first
  Counter delivered;  ///< handed to the kernel, or confirmed where resume is on
  Counter queued;     ///< waiting in an outbox, a resume buffer or (counted at the sending shard) a
                      ///< mailbox
  std::array<Counter, proto::kDropReasonCount> dropped;

  // Traffic
  Counter received_bytes;
  Counter sent_bytes;
  Counter receive_calls;
  Counter send_calls;
  Counter turns;
  // Copying: what was copied on the way through, in payload-carrying bytes
  Counter copied_bytes;      ///< into outboxes: small runs, and small frames that have to wait
  Counter moved_tail_bytes;  ///< the begun frame at the end of a read
  // Between shards
  Counter mailbox_entries;
  Counter mailbox_frames;
  Counter mailbox_wakeups;
  // Events
  Counter connections;  ///< attached now
  Counter sessions;     ///< connections and sessions within their grace time
  Counter malformed;    ///< connections closed for it
  Counter wrong_source;
  Counter silent;
  Counter slow_consumers;
  Counter stalled_frames;
  Counter unfinished_frames;  ///< connections that broke in the middle of a frame
  Counter too_many_requests;
  Counter oddities;
  Counter no_memory;
  Counter pauses;
  Counter resumes;
  Counter reports;
  Counter reports_lost;    ///< REPORTs to nodes of other hubs, to which there was no way
  Counter held_reads;      ///< times a sender that ignored PAUSE was not read
  Counter untaken_frames;  ///< read at the hub's end and left to their senders: not accepted, not
                           ///< confirmed
  Counter gap_frames;      ///< let go at a resume and announced with SKIP; at most kGapFramesMost
  Counter resumed;
  Counter lane0_demoted;  ///< frames
  Counter bad_credits;  ///< CREDITs for no subscription of the node, or with a total that cannot be
  Counter not_retained;  ///< messages of retained services that were not kept
  Counter scarce_turns;  ///< that began with less than a third of a budget free
  Counter pinned_bytes;  ///< kept from being freed by waiting frames, now
  Counter pinned_bytes_max;
  Counter allocated_bytes;  ///< by the shard's thread since it began
};

}  // namespace gimnet::hub
