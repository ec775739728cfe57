#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/mutex.hpp"
#include "client/gimi/ack_window.hpp"
#include "client/gimi/clerk.hpp"
#include "client/gimi/ending.hpp"
#include "client/gimi/loss_tally.hpp"
#include "client/gimi/uplink.hpp"
#include "gimnet/gimi/handles.hpp"

namespace gimnet::gimi {

class SendStream;

/// Looks after streams with messages that wait for an ACK.
class StreamKeeper {
 public:
  /// The stream wants tick() from now on until it answers false. Called without a lock.
  virtual void watch(SendStream& stream) = 0;

 protected:
  ~StreamKeeper() = default;
};

/// The place of a service that a stream leads to.
struct ServicePlace {
  std::uint32_t group = 0;     ///< 0: none at the moment
  std::uint32_t provider = 0;  ///< 0: nobody
  std::uint64_t session = 0;   ///< of the provider
  MessageKey key;
  bool accepts = false;  ///< it takes data, and gives none
  bool latest = false;   ///< of Delivery::latest
  bool away = false;  ///< it accepts, and its node has lost its connection and not accepted again

  /// The destination of messages; 0: nobody takes them.
  [[nodiscard]] std::uint32_t destination() const { return provider != 0 ? group : 0; }
};

/// The behaviour of send() while the service is away.
enum class AtAway : std::uint8_t { refuse, wait };

/// A stream of DATA with one key, to one node or to whoever accepts one service. Thread safety: any
/// thread; nothing that is called from the library's thread waits for a thread that sends.
class SendStream {
 public:
  SendStream(Uplink& uplink, StreamKeeper& keeper, Peer to, const SendOptions& options)
      : uplink_(uplink),
        keeper_(keeper),
        to_(to),
        options_(options),
        destination_{NIF_UNICAST, to.id, options.key, Uplink::draw_epoch()},
        window_(window_of(options)) {}
  /// `service`: its full name.
  SendStream(Uplink& uplink, StreamKeeper& keeper, std::string service, const ServicePlace& place,
             const SendOptions& options)
      : uplink_(uplink),
        keeper_(keeper),
        service_(std::move(service)),
        options_(options),
        place_(place),
        destination_{NIF_SERVICE, place.destination(), place.key, Uplink::draw_epoch()},
        window_(window_of(options)) {}

  /// Without any time (kNoWait) it is a try: the program may try again.
  [[nodiscard]] Outcome<void> send(BytesView data, Timeout timeout, More more,
                                   AtAway at_away = AtAway::refuse,
                                   AtTimeout at_timeout = AtTimeout::give_up)
      GIMNET_EXCLUDES(mutex_);
  /// send(), and waits for what becomes of this one message; also of a stream without a window.
  [[nodiscard]] Outcome<void> send_confirmed(BytesView data, Timeout timeout,
                                             AtAway at_away = AtAway::refuse)
      GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] Outcome<void> settle(Timeout timeout) GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] SendCounts counts() GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] const SendOptions& options() const { return options_; }
  /// Nobody, of a stream to a service.
  [[nodiscard]] Peer to() const { return to_; }
  /// "" of a stream to a node.
  [[nodiscard]] const std::string& service() const { return service_; }
  /// Drawn when the stream is made, and when its service has another provider; tells it from those
  /// of a former process under the same id.
  [[nodiscard]] std::uint32_t epoch() GIMNET_EXCLUDES(mutex_);

  /// True: a message that is held can go; tick() sends it.
  [[nodiscard]] bool on_ack(std::uint32_t sequence, const proto::gimi::Ack& ack)
      GIMNET_EXCLUDES(mutex_);
  /// One message is known to be lost.
  void on_lost(std::uint32_t sequence, const Loss& why) GIMNET_EXCLUDES(mutex_);
  /// The receiver does not take the message. Counts it as on_lost() does; a send() that still
  /// goes on answers with `why`.
  void on_refused(std::uint32_t sequence, const Loss& why) GIMNET_EXCLUDES(mutex_);
  /// Messages may be lost, and that is why: ask.
  void on_doubt(const Loss& why) GIMNET_EXCLUDES(mutex_);
  /// Messages that wait are lost, or nobody will ever tell.
  void on_broken(const Loss& why) GIMNET_EXCLUDES(mutex_);
  /// The service is somewhere else now: what waits for an ACK from its former place gets none any
  /// more.
  void on_moved(const ServicePlace& place) GIMNET_EXCLUDES(mutex_);
  void end(const Ending& ending) GIMNET_EXCLUDES(mutex_);
  /// Nothing waits for an ACK or is held, and nobody ticks.
  [[nodiscard]] bool idle() GIMNET_EXCLUDES(mutex_);
  /// Of a stream to a service: its group; 0: nobody has it.
  [[nodiscard]] std::uint32_t group() GIMNET_EXCLUDES(mutex_);

  /// Puts a PING behind what waits for too long, sends what is held. False: nothing waits. Does not
  /// block.
  [[nodiscard]] bool tick(std::int64_t now_ns) GIMNET_EXCLUDES(mutex_);

 private:
  enum class Turn : std::uint8_t { send, held };
  struct Destination {
    nif_kind kind = NIF_UNICAST;
    std::uint32_t id = 0;  ///< 0: a service that nobody has
    MessageKey key;
    std::uint32_t epoch = 0;
  };
  /// A message for whose fate its thread waits.
  struct Confirmation {
    std::uint32_t sequence = 0;
    bool acknowledged = false;
    Loss loss;  ///< set once it is lost
    [[nodiscard]] bool decided() const { return acknowledged || loss; }
  };
  /// The terms of one call of send().
  struct Order {
    std::int64_t deadline_ns = 0;
    More more = More::no;
    AtAway at_away = AtAway::refuse;
    AtTimeout at_timeout = AtTimeout::give_up;
    Confirmation* confirmation = nullptr;  ///< null: nobody waits for the fate of this message
  };
  /// A message between its sequence and NIF.
  struct Departure {
    std::uint32_t sequence = 0;
    bool asks = false;  ///< for an ACK
    More more = More::no;
  };
  /// A stream without a window has as much room for messages to be confirmed as the largest one.
  [[nodiscard]] static std::size_t window_of(const SendOptions& options) {
    return options.window != 0 ? options.window : kWindowMax;
  }
  [[nodiscard]] bool synchronized() const { return options_.window != 0; }
  [[nodiscard]] Outcome<void> send(BytesView data, const Order& order) GIMNET_EXCLUDES(mutex_);
  /// Waits for this thread's turn, and for room in the window. After Turn::send `sending_` is this
  /// thread's.
  [[nodiscard]] Outcome<Turn> take_turn(BytesView data, const Order& order) GIMNET_REQUIRES(mutex_);
  [[nodiscard]] Outcome<void> await(const Confirmation& confirmation, std::int64_t deadline_ns)
      GIMNET_REQUIRES(mutex_);
  /// The refusal to send to a service that nobody has, or that is away.
  [[nodiscard]] Failure nobody_there() const GIMNET_REQUIRES(mutex_);
  [[nodiscard]] nif_status transmit(const Destination& to, const proto::gimi::MessageHeader& header,
                                    BytesView data, More more, std::int32_t timeout_ms) const;
  [[nodiscard]] nif_status transmit_ping(const Destination& to, std::uint32_t number) const;
  [[nodiscard]] bool finish(const Departure& departure, nif_status status) GIMNET_REQUIRES(mutex_);
  void hold(BytesView data) GIMNET_REQUIRES(mutex_);
  void hold_again(std::vector<std::byte> data) GIMNET_REQUIRES(mutex_);
  void lose_all(const Loss& why) GIMNET_REQUIRES(mutex_);
  void forget_doubts() GIMNET_REQUIRES(mutex_);
  /// REQUIRES: something was lost.
  [[nodiscard]] Failure loss() const GIMNET_REQUIRES(mutex_);
  void settle_freed(const AckWindow::Freed& freed, const Loss& why) GIMNET_REQUIRES(mutex_);
  void watch_if_needed() GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] std::string target() const { return service_.empty() ? to_.text() : service_; }

  Uplink& uplink_;
  StreamKeeper& keeper_;
  const Peer to_;
  const std::string service_;
  const SendOptions options_;

  Mutex mutex_;
  Condition changed_;
  ServicePlace place_ GIMNET_GUARDED_BY(mutex_);  ///< of a stream to a service
  /// When it was told that the service is away now; 0: it is not, or was before.
  std::int64_t away_since_ns_ GIMNET_GUARDED_BY(mutex_) = 0;
  Destination destination_ GIMNET_GUARDED_BY(mutex_);
  AckWindow window_ GIMNET_GUARDED_BY(mutex_);
  SendCounts counts_ GIMNET_GUARDED_BY(mutex_);
  /// One for each thread in send_confirmed(). Limit: the threads of the program.
  std::vector<Confirmation*> confirmations_ GIMNET_GUARDED_BY(mutex_);
  std::optional<std::vector<std::byte>> held_ GIMNET_GUARDED_BY(mutex_);
  bool sending_ GIMNET_GUARDED_BY(mutex_) = false;  ///< one thread is between a sequence and NIF
  bool unflushed_ GIMNET_GUARDED_BY(mutex_) =
      false;  ///< NIF holds messages back because of More::yes
  bool watched_ GIMNET_GUARDED_BY(mutex_) = false;
  /// Why messages may be lost, as the hub reported it since the last PING, if it did. A PONG that
  /// answers a PING behind all of it settles it: `asked_` is what was in doubt when the open PING
  /// was sent.
  Loss doubt_ GIMNET_GUARDED_BY(mutex_);
  Loss asked_ GIMNET_GUARDED_BY(mutex_);
  /// The message that its receiver refused last, and its words.
  std::uint32_t refused_sequence_ GIMNET_GUARDED_BY(mutex_) = 0;
  std::string refusal_ GIMNET_GUARDED_BY(mutex_);
  Ending end_ GIMNET_GUARDED_BY(mutex_);
};

}  // namespace gimnet::gimi
