#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "base/ids.hpp"
#include "hub/concurrent/mpsc_queue.hpp"
#include "hub/concurrent/waker.hpp"
#include "hub/data/fanout/mailbox.hpp"
#include "hub/data/fanout/paced_subscription.hpp"
#include "hub/data/ingress/ingress_gate.hpp"
#include "hub/limits.hpp"
#include "hub/observe/session_gauges.hpp"
#include "net/stream.hpp"
#include "proto/control/link.hpp"
#include "proto/frame/flow.hpp"

// All that the conductor tells a shard, one type each, and all that a shard tells the conductor.
// Nothing else crosses between the two threads, but for the tables that control publishes.
//
// Order: the conductor publishes a node before it sends AttachCommand, which lets WELCOME out, and
// sends AttachCommand before it names the node to anybody else; it tells a subscriber SERVICE_MOVED
// before it makes it a member of the new group, and once more with the AttachCommand of a node that
// comes back; it publishes a member before it sends the PaceCommand for it, and that before the
// answer; it sends a RenumberCommand before it names the new id to anybody else, and publishes a
// group that accepts data before SERVICE_MOVED tells senders of it. So commands that wait are
// carried out before mail that came after them: a frame neither finds its recipient unattached, or
// on a connection on which it has another id, nor overtakes the event about it.
//
// The other way round a shard's mail to other shards and its events to the conductor may overtake
// each other. So a group keeps its members when its provider goes: frames that are on their way are
// delivered, unless another node provides it by then (hub/data/route/router.hpp).

namespace gimnet::hub {

/// A session on a shard, as the conductor names it.
struct SessionRef {
  ConnectionSlot slot;
  std::uint32_t generation = 0;
};

// ---- conductor -> shard
// --------------------------------------------------------------------------------------------

/// Data frames to a link that are kept until they are confirmed, in bytes: what a link of 1 Gbit/s
/// carries in a tenth of a second.
inline constexpr std::uint64_t kLinkResumeBytes = 16 * 1024 * 1024;

/// Control frames that wait for a link, in bytes: the records of 4,000 hubs come at once.
inline constexpr std::uint64_t kLinkControlBytes = 64 * 1024 * 1024;

/// The other end of a connection is a hub.
struct LinkAttach {
  LinkRule rule;
  std::uint32_t silent_ms = 0;
  std::optional<std::int64_t> clock_ahead_ns{};  ///< as LinkClockCommand has it; nothing: not known
  /// This hub dialled: WELCOME was read already, and nothing is written first. `resumed` is what it
  /// said, `epoch` what HELLO said of this end.
  bool dialled = false;
  bool resumed = false;
  std::uint64_t epoch = 0;
  bool counts_anew = false;  ///< the counts of the session begin at 0, if it is not resumed
};

/// An admitted connection for a session, new or come back. The shard fences the session's earlier
/// connection, if it has one (told `replaced`), fixes its counts, writes the 8 bytes of the opening
/// and WELCOME, then carries data.
struct AttachCommand {
  SessionRef session;
  /// Numbers the connections of a session, from 1. What was said to or by an earlier one is told
  /// apart by it.
  std::uint32_t attachment = 0;
  NodeId node;
  /// The shard finds out by itself: by this the simulations judge what the conductor decided.
  bool new_session = true;
  std::unique_ptr<net::Stream> transport;
  /// All of WELCOME but what the shard puts in: resumed, and for a session that can resume taken,
  /// epoch and resume_buffer_bytes.
  proto::Welcome welcome;
  /// The words of HELLO on resume: wanted, epochs, count, buffer.
  bool resume_wanted = false;
  std::uint64_t peer_epoch = 0;
  std::uint64_t known_hub_epoch = 0;
  std::uint64_t known_taken = 0;
  std::uint32_t peer_resume_bytes = 0;
  std::uint32_t peer_frame_bytes = 0;
  std::optional<LinkAttach> link;  ///< nothing: a node
  /// Control frames that the node gets ahead of all that waits for it, whatever their size: events
  /// that it may have missed.
  std::vector<std::byte> told;
};

/// The subscriber's counts of that group begin at 0, with what is written from now on.
struct CountsBegin {
  GroupId group;
  std::uint8_t number = 0;  ///< that the subscriber gave them
};

/// A control frame (header and payload) for a session; goes before the data lanes. `answers` is how
/// many of the session's unanswered requests it settles: 1 for an answer, 0 for an event. An answer
/// is for the connection that asked: it is dropped if `attachment` is not the present one. 0 is
/// whichever there is; without one it is dropped. `may_drop`: an event that does not close the
/// connection if its control queue is half full, but is missed (EventsMissedEvent).
struct SendControlCommand {
  SessionRef session;
  std::uint32_t attachment = 0;
  std::vector<std::byte> frame;
  std::uint32_t answers = 0;
  std::optional<CountsBegin> counts{};  ///< that begin with the frame
  bool may_drop = false;
  bool passed_on = false;  ///< over a link, of somebody else: dropped where it has no room
};

/// One event for many sessions of a shard, encoded once: each gets it as by a SendControlCommand
/// that may be dropped.
struct TellCommand {
  /// As many sessions as the commands that a shard carries out in one turn.
  static constexpr std::size_t kToMost = 256;
  struct To {
    SessionRef session;
    NodeId node;
  };
  std::vector<To> to;            ///< at most kToMost
  std::vector<std::byte> frame;  ///< to node 0: set_destination() for each of them
};

/// Tells a connection the present state of everything whose events it missed: control frames, ahead
/// of all that waits for it, whatever their size. From here on it gets events again. Does nothing
/// if `attachment` is not the present one.
struct TellAgainCommand {
  SessionRef session;
  std::uint32_t attachment = 0;
  std::vector<std::byte> frames;
};

/// Say GOODBYE and close the session's connection. The session itself stays until ReleaseCommand.
struct CloseCommand {
  SessionRef session;
  proto::GoodbyeCode code{};
  std::string sentence;
  /// Of a link: not before nothing was under way for so long, in either direction.
  std::uint32_t quiet_ms = 0;
  std::uint32_t most_ms = 0;  ///< but at the latest after this time; 0: at once
};

/// The session is over: what waits for it is dropped (`link_lost`), its slot is free for a later
/// generation.
struct ReleaseCommand {
  SessionRef session;
};

/// The session's subscription to that group is paced from now on, or has other terms. `retained`:
/// it begins with the last message. `was_plain`: until then it got everything. `number`: of its
/// counts, if it begins. `with_event`: it does not begin on a connection that misses events, since
/// its node does not know the group yet; it is sent again behind the TellAgainCommand.
struct PaceCommand {
  SessionRef session;
  GroupId group;
  PaceTerms terms;
  bool retained = false;
  bool was_plain = false;
  std::uint8_t number = 0;
  bool with_event = false;
};

/// A paced subscription ended, or its group is gone.
struct EndPaceCommand {
  SessionRef session;
  GroupId group;
};

/// To the shard of a node that provides the group no more: its last message is not kept any more,
/// but what the next provider sent there is.
struct ForgetRetainedCommand {
  GroupId group;
  NodeId provider;
};

/// The session's node has another id. Its connection, if it has one, is told so with GOODBYE
/// `renumbered`. What waits for it is dropped (`link_lost`): its next connection is not resumed.
struct RenumberCommand {
  SessionRef session;
  NodeId node;
  std::string sentence;
};

/// The clock of the hub at the other end of a link is so far ahead of this hub's.
struct LinkClockCommand {
  SessionRef session;
  std::chrono::nanoseconds ahead{};
};

/// The limits that the shard obeys from its next turn on.
struct LimitsCommand {
  Limits limits;
};

/// Read nothing more; when all shards have taken theirs, say GOODBYE `draining` to everybody after
/// what waits was written, or at the deadline; then answer DrainedEvent.
struct DrainCommand {
  std::uint64_t deadline_ms = 0;  ///< from now
};

/// End the shard's thread.
struct StopCommand {};

using ShardCommand =
    std::variant<AttachCommand, SendControlCommand, TellCommand, TellAgainCommand, CloseCommand,
                 ReleaseCommand, RenumberCommand, LinkClockCommand, LimitsCommand, PaceCommand,
                 EndPaceCommand, ForgetRetainedCommand, DrainCommand, StopCommand>;

// ---- shard -> conductor
// --------------------------------------------------------------------------------------------

/// A frame of kind NS or CTRL, of a link also ROUTE, or the header alone of one that was dropped.
/// `frame` is header and payload. `node` is the sender's, of a link the hub at its other end.
struct ControlFrameEvent {
  SessionRef session;
  std::uint32_t attachment = 0;  ///< of the connection that it came by
  NodeId node;
  std::vector<std::byte> frame;
};

/// A session has no connection any more. `code` is `done` only if the node said so itself: then the
/// session is over, otherwise its grace time begins. `said_by_peer` tells who said GOODBYE;
/// `sentence` is for the record. A connection that broke without a GOODBYE has code `done` and
/// `said_by_peer` false. None is sent for a connection that was fenced by a newer one of its
/// session.
struct DetachedEvent {
  SessionRef session;
  std::uint32_t attachment = 0;  ///< of the connection that ended
  NodeId node;
  bool said_by_peer = false;
  proto::GoodbyeCode code{};
  std::string sentence;
  // Of a link, for the HELLO by which it may be resumed; 0: it cannot be.
  std::uint64_t epoch = 0;       ///< of this end
  std::uint64_t peer_epoch = 0;  ///< of the other end
  std::uint64_t taken = 0;       ///< data frames from the other end
};

/// The session of a link was released, and came to that in the end.
struct ReleasedEvent {
  SessionRef session;
  SessionCounts counts;
};

/// Events for a connection were dropped, because its control queue was half full; now it is empty.
/// More are dropped until the TellAgainCommand that answers this.
struct EventsMissedEvent {
  SessionRef session;
  std::uint32_t attachment = 0;
  NodeId node;
};

/// The subscriptions of a node missed so many messages of that group, in total.
struct MissedEvent {
  SessionRef session;
  NodeId node;
  proto::flow::Missed missed;
};

/// A connection to which GOODBYE was written: what its peer still sends is thrown away for a
/// moment, since closing with unread bytes would reset the connection and could take the GOODBYE
/// with it.
struct FarewellEvent {
  std::unique_ptr<net::Stream> transport;
};

/// The shard has nothing left to write, nor any other for it (answer to DrainCommand).
struct DrainedEvent {};

struct ShardEvent {
  ShardIndex shard;
  std::variant<ControlFrameEvent, DetachedEvent, ReleasedEvent, EventsMissedEvent, MissedEvent,
               FarewellEvent, DrainedEvent>
      what;
};

/// The door from the shards to the conductor, for control frames and the ends of connections. Never
/// on the data path. Thread safety: push() from each shard's thread with that shard's index; the
/// rest from the conductor.
class ControlInbox {
 public:
  explicit ControlInbox(std::size_t shards) : queue_(shards), pushed_(shards), taken_(shards) {}

  /// Shard: hands an event over and wakes the conductor if it sleeps. Order per shard is kept.
  void push(ShardEvent event) {
    const std::size_t shard = event.shard.value();
    queue_.push(shard, std::move(event));
    pushed_[shard].fetch_add(
        1, std::memory_order_release);  // pairs with the acquire in drain_present()
    waker_.wake();
  }

  /// Conductor: calls `take` for up to `most` events; returns how many.
  template <class Take>
  std::size_t drain(std::size_t most, Take&& take) {
    return queue_.drain(most, [&](ShardEvent&& event) {
      ++taken_[event.shard.value()];
      take(std::move(event));
    });
  }
  /// Conductor: calls `take` for all events that were pushed before, however many; later ones may
  /// be among them.
  template <class Take>
  void drain_present(Take&& take) {
    for (std::size_t shard = 0; shard < pushed_.size(); ++shard) {
      // acquire pairs with the release in push(): what was counted can be taken.
      const std::uint64_t present = pushed_[shard].load(std::memory_order_acquire);
      while (taken_[shard] < present && drain(kEventsABatch, take) != 0) {
      }
    }
  }
  /// The conductor takes so many at a time, before it lets others have a turn.
  static constexpr std::size_t kEventsABatch = 256;
  /// Conductor: its descriptor becomes readable at push() after prepare_to_sleep().
  [[nodiscard]] Waker& waker() { return waker_; }
  [[nodiscard]] bool empty() const { return queue_.empty(); }

 private:
  MpscQueue<ShardEvent> queue_;
  std::vector<std::atomic<std::uint64_t>> pushed_;  ///< by shard, since the start
  std::vector<std::uint64_t> taken_;                ///< the conductor's: the same
  Waker waker_;
};

}  // namespace gimnet::hub
