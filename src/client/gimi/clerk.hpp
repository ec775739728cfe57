#pragma once

#include <atomic>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

#include "base/mutex.hpp"
#include "client/gimi/uplink.hpp"
#include "gimnet/gimi/message.hpp"
#include "net/wait.hpp"
#include "proto/gimi/message_header.hpp"

namespace gimnet::gimi {

/// One stream as a table names it: the other node, the key, and of one to a service its group. A
/// sender that does not know who has the service names nobody.
struct StreamName {
  Peer peer;
  MessageKey key;
  std::uint32_t group = 0;
  friend auto operator<=>(const StreamName&, const StreamName&) = default;
};
struct StreamNameHash {
  std::size_t operator()(const StreamName& name) const noexcept {
    const std::uint64_t key = name.key.type | (static_cast<std::uint64_t>(name.key.instance) << 32);
    // Fibonacci hashing: ids and keys are small numbers that differ in their low bits.
    const std::uint64_t ids =
        (static_cast<std::uint64_t>(name.peer.id) << 17) ^ (std::uint64_t{name.group} << 31);
    return static_cast<std::size_t>((key ^ ids) * 0x9E3779B97F4A7C15u);
  }
};

/// Which DATA of each sender were taken: the highest sequence and the 64 before it, which is what
/// an ACK says. In the order of streams, which no choice of keys can make slow. Thread safety: one
/// thread at a time. Limits: `kStreamsMax` streams; beyond them one is forgotten that is next to
/// the new one, mostly of the same sender, and its next ACK speaks only of what came after.
class AckBook {
 public:
  static constexpr std::size_t kStreamsMax = 65536;

  /// A DATA that asked for an ACK was taken; of another epoch it begins a new count. True: the
  /// sender is due for an ACK, and was not before.
  bool take(const StreamName& sender, const proto::gimi::MessageHeader& data);

  struct Entry {
    std::uint32_t epoch = 0;
    std::uint32_t sequence = 0;
    std::uint64_t bitmap = 0;
    bool due = false;
  };
  /// The messages to acknowledge now; they are no longer due. Zeros if nothing came from there.
  Entry acknowledge(const StreamName& sender);
  /// An acknowledgement could not be sent: it stays due.
  void hold(const StreamName& sender);
  [[nodiscard]] std::size_t size() const { return entries_.size(); }

 private:
  std::map<StreamName, Entry> entries_;
};

class Inbox;
class OpenRequests;
class StreamTable;

/// The work of a node that is due at times, on NIF's thread: acknowledges what was taken, one ACK
/// for as many messages as came meanwhile, lets streams ask for the ACKs that they miss, sends
/// requests again, and tells wait sets of silence. It never waits: what has no room is tried again.
/// Thread safety: as each group of functions says.
class Clerk {
 public:
  /// `requests` and `inbox` may be null.
  Clerk(Uplink& uplink, StreamTable& streams, OpenRequests* requests = nullptr,
        Inbox* inbox = nullptr)
      : uplink_(uplink), streams_(streams), requests_(requests), inbox_(inbox) {}

  // Any thread but NIF's.
  /// From now on NIF's thread does the work. REQUIRES: the uplink is open.
  void start() {
    uplink_.set_task([this] { return run(); });
  }
  /// Waits until the ACKs that are due are sent, and ends the work. REQUIRES: started.
  void stop() GIMNET_EXCLUDES(mutex_);

  // Any thread.
  /// Streams want to be looked after, soon or at once.
  void attend(bool at_once);

  // NIF's thread.
  /// A DATA that asked for an ACK is in its queue.
  void take(const StreamName& sender, Lane lane, const proto::gimi::MessageHeader& data);
  /// Sends the ACK that goes before the PONG for that PING. Does not wait.
  [[nodiscard]] nif_status acknowledge(const StreamName& sender, Lane lane,
                                       const proto::gimi::MessageHeader& ping);

 private:
  struct Due {
    StreamName sender;
    Lane lane;
  };
  /// Does what is due. Returns when it has to be called again at the latest.
  [[nodiscard]] net::Deadline run() GIMNET_EXCLUDES(mutex_);
  /// `pong`: the number of the PONG that follows, or 0.
  [[nodiscard]] nif_status send_ack(const StreamName& sender, Lane lane, AckBook::Entry taken,
                                    std::uint32_t pong) const;
  /// Keeps in `paused_` what could not be sent because the hub has paused its way.
  void send_due();
  /// A paced queue has to be looked at then.
  [[nodiscard]] std::int64_t inbox_due_ns() const;
  /// Looks after the streams, requests and queues if it is time.
  void tick(std::int64_t now_ns);

  Uplink& uplink_;
  StreamTable& streams_;
  OpenRequests* const requests_;
  Inbox* const inbox_;

  // NIF's thread.
  AckBook book_;
  std::vector<Due> due_;
  std::vector<Due> paused_;
  std::int64_t retry_at_ns_ = INT64_MAX;  ///< of those
  std::int64_t tick_at_ns_ = INT64_MAX;   ///< the next look at the streams; never: none is wanted

  std::atomic<bool> ticking_{false};  ///< somebody wants looks, until one finds nothing
  std::atomic<bool> hurry_{false};    ///< the next look is to be at once
  std::atomic<std::int64_t> give_up_ns_{INT64_MAX};  ///< when stop() waits no longer for ACKs

  Mutex mutex_;
  Condition done_;
  bool stopped_ GIMNET_GUARDED_BY(mutex_) = false;
};

}  // namespace gimnet::gimi
