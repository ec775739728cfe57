#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "base/token_bucket.hpp"
#include "hub/data/egress/gather_writer.hpp"
#include "hub/data/egress/resume_buffer.hpp"
#include "hub/data/fanout/recipient.hpp"
#include "hub/data/ingress/ingress_gate.hpp"
#include "hub/data/ingress/receive_buffer.hpp"
#include "hub/shard/commands.hpp"
#include "hub/shard/poller.hpp"
#include "net/stream.hpp"

namespace gimnet::hub {

/// The reasons for which a connection is not read, as a set. Thread safety: a value type.
class ReadGate {
 public:
  enum Reason : std::uint8_t {
    held = 1,      ///< an outbox holds it: its sender did not heed PAUSE
    no_room = 2,   ///< a shard that it sends to has too much to do
    draining = 4,  ///< it closes once everything is written
    rest = 8,      ///< its last read was not routed whole
  };

  void shut(Reason reason) { reasons_ |= reason; }
  void clear(Reason reason) { reasons_ &= ~unsigned{reason}; }
  /// One of them; several are joined by `|`.
  [[nodiscard]] bool has(unsigned reasons) const { return (reasons_ & reasons) != 0; }
  [[nodiscard]] bool is_open() const { return reasons_ == 0; }

 private:
  unsigned reasons_ = 0;
};

/// A connection's transport as it takes bytes.
enum class WriteState : std::uint8_t {
  open,
  blocked,  ///< it took less than was offered: wait for it
  failed,   ///< nothing any more: read to its end, which tells that it broke
  gone,     ///< there is no transport
};

/// Does a connection get events? One that does not take them misses them until it is told again.
enum class EventState : std::uint8_t {
  told,
  missed,
  asked,  ///< its control queue is empty; the conductor was asked to tell it again
};

/// The readiness that the poller waits for. must_confirm: nothing more can be written before the
/// peer's CONFIRM, which may lie behind data for which it is held: two nodes that flood each other
/// would wait for ever. A rest is routed within the next turns, and is not worth a system call.
[[nodiscard]] inline Interest interest_of(ReadGate gate, WriteState write, bool must_confirm,
                                          std::size_t pending_out) {
  if (write == WriteState::gone) return {};
  const unsigned closed_by = must_confirm ? unsigned{ReadGate::no_room}
                                          : ReadGate::no_room | ReadGate::held | ReadGate::draining;
  return net::interest_of(!gate.has(closed_by), write == WriteState::blocked,
                          write == WriteState::failed ? 0 : pending_out);
}

/// Whether a call that may find nothing is worth its price: tried as long as it finds something,
/// and ever more rarely while it does not, at last each kPauseMax + 1 times. Thread safety: none.
class Backoff {
 public:
  static constexpr std::uint8_t kPauseMax = 63;

  /// Asked once each time that the call could be made; if it then is, one of succeeded() and
  /// failed() follows.
  [[nodiscard]] bool is_due() {
    if (left_ == 0) return true;
    --left_;
    return false;
  }
  void succeeded() { pause_ = left_ = 0; }
  void failed() {
    left_ = pause_;
    pause_ = static_cast<std::uint8_t>(std::min(2 * pause_ + 1, int{kPauseMax}));
  }

 private:
  // A new one has shown nothing yet.
  std::uint8_t pause_ = 7;
  std::uint8_t left_ = 7;  ///< times that it is not worth it
};

/// The state that outlives a broken connection, so that the next one can go on where it ended
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
  bool confirm_due = false;             ///< it stands in ShardState::confirms
};

/// A link that closes once it has carried what is under way: nothing waits at this end, all was
/// confirmed in both directions, and no further frame came for a while. Thread safety: one shard.
/// Limits: CloseCommand::most_ms.
class LinkEnding {
 public:
  /// Data frames of the link so far.
  struct Carried {
    std::uint64_t written = 0;
    std::uint64_t taken = 0;
    friend bool operator==(const Carried&, const Carried&) = default;
  };

  LinkEnding(CloseCommand close, std::uint64_t now_ms)
      : close_(std::move(close)), latest_ms_(now_ms + close_.most_ms), quiet_since_ms_(now_ms) {}

  [[nodiscard]] const CloseCommand& close() const { return close_; }
  /// To be asked from time to time. `waits`: something is not written or not confirmed yet.
  [[nodiscard]] bool is_due(bool waits, const Carried& carried, std::uint64_t now_ms) {
    if (waits || carried != std::exchange(carried_, carried)) quiet_since_ms_ = now_ms;
    return now_ms >= latest_ms_ || now_ms - quiet_since_ms_ >= close_.quiet_ms;
  }

 private:
  const CloseCommand close_;
  const std::uint64_t latest_ms_;
  std::uint64_t quiet_since_ms_;
  Carried carried_;
};

/// The hub at the other end of a link.
struct LinkPeer {
  LinkRule rule;
  std::uint32_t silent_ms = 0;
  /// The clock of the hub there is ahead of this hub's by so much; nothing: not measured yet.
  std::optional<std::int64_t> clock_ahead_ns{};
  TokenBucket control{};  ///< frames for the conductor
  std::optional<LinkEnding> ending{};
};

/// A bit set of shards: any of them.
inline constexpr std::uint64_t kAllShards = ~std::uint64_t{0};

/// The progress of a recipient that does not take everything at once.
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
  bool emptied = false;  ///< since then nothing waited at the hub for a moment
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
  TokenBucket oddities;                      ///< CREDITs of no use, and MISSEDs too many
  TokenBucket missed;                        ///< MISSEDs
  std::uint64_t posted_shards = kAllShards;  ///< that its last read sent to; all, before the first
  GatherWriter writer;
  FrameTail tail;
  IngressState ingress;
  std::uint64_t last_heard_ms = 0;
  std::uint64_t last_sent_ms = 0;
  std::uint64_t last_ping_ms = 0;  ///< when Keeper said PING last
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
  /// CONFIRM is to be written to it in this turn.
  [[nodiscard]] bool confirm_due() const { return resume != nullptr && resume->confirm_due; }
  /// Slots are reused and connections replaced: an event of the poller is for exactly one
  /// attachment.
  [[nodiscard]] std::uint64_t token() const {
    return (static_cast<std::uint64_t>(attachment) << 32) |
           (static_cast<std::uint64_t>(generation & 0xFF) << 24) | slot.value();
  }
};

}  // namespace gimnet::hub
