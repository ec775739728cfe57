#pragma once

#include <array>
#include <cstdint>

#include "hub/observe/counters.hpp"
#include "proto/frame/frame_header.hpp"

namespace gimnet::hub {

/// The counts of a shard while it works, as plain integers. publish() adds them to the counters
/// that others read, once a turn. Thread safety: one shard.
struct Tally {
  std::uint64_t accepted = 0;
  std::uint64_t copies = 0;
  std::uint64_t delivered = 0;
  std::int64_t queued = 0;
  std::array<std::uint64_t, proto::kDropReasonCount> dropped{};
  bool any_dropped = false;
  std::uint64_t received_bytes = 0;
  std::uint64_t sent_bytes = 0;
  std::uint64_t sent_control_bytes =
      0;  ///< of them, of FLOW, LINK, NS and CTRL frames; not published
  std::uint64_t receive_calls = 0;
  std::uint64_t send_calls = 0;
  std::uint64_t copied_bytes = 0;
  std::uint64_t moved_tail_bytes = 0;
  std::uint64_t mailbox_entries = 0;
  std::uint64_t mailbox_frames = 0;
  std::uint64_t lane0_demoted = 0;
  std::uint64_t not_retained = 0;

  void drop(proto::DropReason reason, std::uint64_t frames) {
    dropped[static_cast<std::size_t>(reason)] += frames;
    any_dropped = true;
  }

  void publish(ShardCounters& counters) {
    counters.accepted.add(accepted);
    counters.copies.add(copies);
    counters.delivered.add(delivered);
    counters.queued.add(
        static_cast<std::uint64_t>(queued));  // wraps: only the sum over shards has to be right
    if (any_dropped) {
      for (std::size_t i = 0; i < dropped.size(); ++i) counters.dropped[i].add(dropped[i]);
    }
    counters.received_bytes.add(received_bytes);
    counters.sent_bytes.add(sent_bytes);
    counters.receive_calls.add(receive_calls);
    counters.send_calls.add(send_calls);
    counters.copied_bytes.add(copied_bytes);
    counters.moved_tail_bytes.add(moved_tail_bytes);
    counters.mailbox_entries.add(mailbox_entries);
    counters.mailbox_frames.add(mailbox_frames);
    counters.lane0_demoted.add(lane0_demoted);
    counters.not_retained.add(not_retained);
    *this = Tally{};
  }
};

}  // namespace gimnet::hub
