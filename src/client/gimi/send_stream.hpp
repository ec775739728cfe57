#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/mutex.hpp"
#include "client/gimi/ack_book.hpp"
#include "client/gimi/send_window.hpp"
#include "client/gimi/uplink.hpp"
#include "gimnet/gimi.hpp"

namespace gimnet::gimi {

class SendStream;

/// Who looks after streams with messages that wait for an ACK.
class StreamKeeper {
 public:
  /// The stream wants tick() from now on until it answers false. Called without a lock.
  virtual void watch(SendStream& stream) = 0;

 protected:
  ~StreamKeeper() = default;
};

/// A stream of DATA to one node with one key. Thread safety: any thread; nothing that is called from the library's
/// thread waits for a thread that sends.
class SendStream {
 public:
  SendStream(Uplink& uplink, StreamKeeper& keeper, Peer to, const SendOptions& options)
      : uplink_(uplink), keeper_(keeper), to_(to), options_(options), window_(options.window) {}

  [[nodiscard]] Outcome<void> send(BytesView data, Timeout timeout, More more) GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] Outcome<void> settle(Timeout timeout) GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] SendCounts counts() GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] Peer to() const { return to_; }

  /// True: a message that is held can go; tick() sends it.
  [[nodiscard]] bool on_ack(std::uint32_t sequence, const proto::gimi::Ack& ack) GIMNET_EXCLUDES(mutex_);
  /// One message is known to be lost.
  void on_lost(std::uint32_t sequence, const std::string& why) GIMNET_EXCLUDES(mutex_);
  /// Messages may be lost: ask.
  void on_doubt() GIMNET_EXCLUDES(mutex_);
  /// What waits is lost, or nobody will ever tell.
  void on_broken(const std::string& why) GIMNET_EXCLUDES(mutex_);
  void close() GIMNET_EXCLUDES(mutex_);

  /// Puts a PING behind what waits for too long, sends what is held. False: nothing waits. Does not block.
  [[nodiscard]] bool tick(std::int64_t now_ns) GIMNET_EXCLUDES(mutex_);

 private:
  enum class Turn : std::uint8_t { send, held };
  /// Waits for this thread's turn, and for room in the window. After Turn::send `sending_` is this thread's.
  [[nodiscard]] Outcome<Turn> take_turn(BytesView data, std::int64_t deadline) GIMNET_REQUIRES(mutex_);
  [[nodiscard]] nif_status transmit(proto::gimi::Operation operation, std::uint32_t number, BytesView data, More more,
                                    std::int32_t timeout_ms) const;
  [[nodiscard]] nif_status transmit_ping(std::uint32_t number) const;
  [[nodiscard]] bool finish(std::uint32_t sequence, nif_status status, More more) GIMNET_EXCLUDES(mutex_);
  void hold(BytesView data) GIMNET_REQUIRES(mutex_);
  void settle_freed(const SendWindow::Freed& freed, const std::string& why) GIMNET_REQUIRES(mutex_);
  void watch_if_needed() GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] std::string target() const { return "send to " + to_.text(); }

  Uplink& uplink_;
  StreamKeeper& keeper_;
  const Peer to_;
  const SendOptions options_;

  Mutex mutex_;
  Condition changed_;
  SendWindow window_ GIMNET_GUARDED_BY(mutex_);
  SendCounts counts_ GIMNET_GUARDED_BY(mutex_);
  std::optional<std::vector<std::byte>> held_ GIMNET_GUARDED_BY(mutex_);
  bool sending_ GIMNET_GUARDED_BY(mutex_) = false;    ///< one thread is between a sequence and NIF
  bool unflushed_ GIMNET_GUARDED_BY(mutex_) = false;  ///< NIF holds messages back because of More::yes
  bool watched_ GIMNET_GUARDED_BY(mutex_) = false;
  bool closed_ GIMNET_GUARDED_BY(mutex_) = false;
};

}  // namespace gimnet::gimi
