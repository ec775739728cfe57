#pragma once

#include <cstdint>
#include <thread>
#include <vector>

#include "base/mutex.hpp"
#include "client/gimi/ack_book.hpp"
#include "client/gimi/uplink.hpp"

namespace gimnet::gimi {

class StreamTable;

/// A node's own thread: acknowledges what was taken, one ACK for as many messages as came
/// meanwhile, and lets streams ask for the ACKs that they miss. It sleeps while there is nothing to
/// do. Thread safety: any thread.
class Clerk {
 public:
  Clerk(Uplink& uplink, StreamTable& streams) : uplink_(uplink), streams_(streams) {}

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
