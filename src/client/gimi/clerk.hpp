#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <map>
#include <thread>
#include <vector>

#include "base/mutex.hpp"
#include "client/gimi/uplink.hpp"
#include "gimnet/gimi/message.hpp"
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
  /// An acknowledgement could not be sent: it stays due. True: it had become due anew.
  bool hold(const StreamName& sender);
  [[nodiscard]] std::size_t size() const { return entries_.size(); }

 private:
  std::map<StreamName, Entry> entries_;
};

class Inbox;
class OpenRequests;
class StreamTable;

/// A node's own thread: acknowledges what was taken, one ACK for as many messages as came
/// meanwhile, lets streams ask for the ACKs that they miss, sends requests again, and tells wait
/// sets of silence. It sleeps while there is nothing to do. Thread safety: any thread.
class Clerk {
 public:
  /// `requests` and `inbox` may be null.
  Clerk(Uplink& uplink, StreamTable& streams, OpenRequests* requests = nullptr,
        Inbox* inbox = nullptr)
      : uplink_(uplink), streams_(streams), requests_(requests), inbox_(inbox) {}

  void start();
  /// Sends the ACKs that are due, and ends the thread. REQUIRES: not from the clerk's own thread.
  void stop() GIMNET_EXCLUDES(mutex_);

  /// A DATA that asked for an ACK is in its queue.
  void take(const StreamName& sender, Lane lane, const proto::gimi::MessageHeader& data)
      GIMNET_EXCLUDES(mutex_);
  /// Sends the ACK that goes before the PONG for that PING, from the thread of the caller. Does not
  /// wait.
  [[nodiscard]] nif_status acknowledge(const StreamName& sender, Lane lane,
                                       const proto::gimi::MessageHeader& ping)
      GIMNET_EXCLUDES(mutex_);
  /// Streams want to be looked after, soon or at once.
  void attend(bool at_once) GIMNET_EXCLUDES(mutex_);

 private:
  struct Due {
    StreamName sender;
    Lane lane;
  };
  void run();
  /// `pong`: the number of the PONG that follows, or 0.
  [[nodiscard]] nif_status send_ack(const StreamName& sender, Lane lane, AckBook::Entry taken,
                                    std::uint32_t pong) const;
  /// `paused`: an ACK is to be tried again.
  void wait_for_work(std::int64_t& tick_at, bool paused) GIMNET_REQUIRES(mutex_);
  /// Keeps in `due` what could not be sent because the hub has paused its way.
  void send_due(std::vector<Due>& due);

  Uplink& uplink_;
  StreamTable& streams_;
  OpenRequests* const requests_;
  Inbox* const inbox_;
  std::thread thread_;

  Mutex mutex_;
  Condition work_;
  AckBook book_ GIMNET_GUARDED_BY(mutex_);
  std::vector<Due> due_ GIMNET_GUARDED_BY(mutex_);
  bool ticking_ GIMNET_GUARDED_BY(mutex_) = false;
  bool hurry_ GIMNET_GUARDED_BY(mutex_) = false;
  bool stopping_ GIMNET_GUARDED_BY(mutex_) = false;
};

}  // namespace gimnet::gimi
