#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "base/token_bucket.hpp"
#include "hub/data/egress/gather_writer.hpp"
#include "hub/data/egress/resume_buffer.hpp"
#include "hub/data/fanout/recipient.hpp"
#include "hub/data/ingress/ingress_gate.hpp"
#include "hub/data/ingress/receive_buffer.hpp"
#include "hub/shard/backoff.hpp"
#include "hub/shard/commands.hpp"
#include "hub/shard/connection_state.hpp"
#include "hub/shard/poller.hpp"
#include "net/stream.hpp"

namespace gimnet::hub {

/// What outlives a broken connection, so that the next one can go on where it ended
/// (docs/protocol.md, section 3).
struct ResumeState {
  explicit ResumeState(std::uint64_t bytes_max) : kept(bytes_max) {}

  ResumeBuffer kept;  ///< to the node
  std::uint64_t hub_epoch = 0;
  std::uint64_t peer_epoch = 0;
  std::uint64_t taken = 0;              ///< data frames from the node
  std::uint64_t taken_told = 0;         ///< of them, in the last CONFIRM
  std::uint64_t bytes_since_told = 0;   ///< taken since the last CONFIRM
  std::uint32_t peer_resume_bytes = 0;  ///< a quarter of it without a CONFIRM is too much
};

/// The hub at the other end of a link.
struct LinkPeer {
  LinkRule rule;
  std::uint32_t silent_ms = 0;
  TokenBucket control{};  ///< frames for the conductor
};

/// A bit set of shards: any of them.
inline constexpr std::uint64_t kAllShards = ~std::uint64_t{0};

/// How a recipient that does not take everything at once gets on.
struct Progress {
  std::uint64_t taken_bytes = 0;  ///< that left the send queue, when last looked at
  std::uint64_t since_ms = 0;     ///< it has taken less than the least since then
  std::uint64_t owed_bytes =
      0;                       ///< had been sent when messages were dropped because it took nothing
  std::uint64_t data_end = 0;  ///< of all bytes sent, where those end that came from lanes
  std::uint64_t block_taken_bytes = 0;
  std::uint64_t block_since_ms = 0;
  std::uint64_t rate_bytes = 0;  ///< taken when the rate was last measured
  std::uint64_t rate_since_ms = 0;
};

/// A session on its shard, and its connection while it has one. There are as many as nodes, most of
/// them idle: what few of them need is made when they need it, and the members stand so that little
/// is lost between them. Thread safety: one shard.
struct Connection : Recipient {
  Interest armed;
  ReadGate gate;
  WriteState write = WriteState::gone;
  bool must_confirm = false;  ///< nothing more can be written before its CONFIRM: read even if held
  EventState events = EventState::told;
  bool gauged = false;         ///< its queue gauge is not 0
  bool missed_resume = false;  ///< RESUME had no place: it would stay paused for ever
  bool goes_on = false;        ///< its token stands in with_rest
  Backoff read_again;          ///< of reading it twice in a turn
  std::uint32_t attachment = 0;
  std::uint32_t holds = 0;     ///< by outboxes
  std::uint32_t requests = 0;  ///< that are unanswered
  std::uint32_t ping_sequence = 0;
  std::uint32_t unsent_limit = 0;            ///< of the transport; 0: not limited
  std::unique_ptr<net::Stream> transport;    ///< nullptr: away
  TokenBucket oddities;                      ///< CREDITs of no use
  std::uint64_t posted_shards = kAllShards;  ///< that its last read sent to; all, before the first
  GatherWriter writer;
  FrameTail tail;
  IngressState ingress;
  std::uint64_t last_heard_ms = 0;
  std::uint64_t last_sent_ms = 0;
  std::uint64_t tail_since_ms = 0;
  std::uint64_t sent_bytes = 0;
  std::unique_ptr<Progress> progress;  ///< while something waits
  std::unique_ptr<ResumeState> resume;
  std::unique_ptr<LinkPeer> link;  ///< nullptr: a node

  /// It could not be heard, nor finish a frame, while the hub did not read it.
  void on_read_again(std::uint64_t now_ms) {
    last_heard_ms = now_ms;
    if (tail_since_ms != 0) tail_since_ms = now_ms;
  }
  [[nodiscard]] SessionRef session() const { return {slot, generation}; }
  /// Slots are reused and connections replaced: an event of the poller is for exactly one
  /// attachment.
  [[nodiscard]] std::uint64_t token() const {
    return (static_cast<std::uint64_t>(attachment) << 32) |
           (static_cast<std::uint64_t>(generation & 0xFF) << 24) | slot.value();
  }
};

}  // namespace gimnet::hub
