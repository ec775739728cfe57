#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "hub/control/acceptor.hpp"
#include "hub/limits.hpp"
#include "hub/observe/request_counters.hpp"
#include "net/accept_handshake.hpp"

namespace gimnet::hub {

/// The log's line about a peer that was not admitted.
void log_refusal(const PeerInfo& who, const proto::Goodbye& goodbye);

/// Peers that have not been admitted: each owns one small buffer and a deadline, nothing else.
/// Those who say HELLO are judged; those who are refused are told why, and given a moment to read
/// it. Thread safety: none. Ownership: of their transports until they are admitted. Limits:
/// limits.handshakes, and limits.handshakes_per_address of them from one address; one more ends the
/// oldest of these, unless its HELLO is there by now. As many may leave. Time is an argument.
class WaitingRoom {
 public:
  /// Takes the stranger's transport and returns nothing, or leaves it and says why not.
  using Judge = std::function<std::optional<proto::Goodbye>(Stranger&, const proto::Hello&)>;

  /// REQUIRES: limits and refusals outlive it.
  WaitingRoom(const Limits& limits, Judge judge, RefusalCounters& refusals);
  ~WaitingRoom();
  WaitingRoom(const WaitingRoom&) = delete;
  WaitingRoom& operator=(const WaitingRoom&) = delete;

  /// REQUIRES: a transport with a descriptor.
  void enter(Stranger stranger, std::chrono::milliseconds now);
  /// A peer to which GOODBYE was written elsewhere: it gets the same moment. REQUIRES: a transport
  /// with a descriptor.
  void see_off(std::unique_ptr<net::Stream> transport, std::chrono::milliseconds now);
  /// There are no descriptors: ends the one who is leaving longest, else the one who waits longest
  /// without HELLO. Who may administer the hub makes way only for its like.
  [[nodiscard]] Acceptor::Room give_way_to(const Stranger& newcomer);
  /// Reads what strangers said, one batch. True: there may be more.
  bool serve(std::chrono::milliseconds now);
  /// The hub stood still for so long until now, and read nothing: so much more time have those who
  /// wait or leave.
  void stood_still(std::chrono::milliseconds time, std::chrono::milliseconds now);
  /// Ends those whose time is over, but judges whose HELLO is there by now.
  void tick(std::chrono::milliseconds now);
  /// Refuses everybody, as at the end of the hub: nobody enters any more, and each of those who
  /// leave has its time.
  void dismiss_all(const proto::Goodbye& goodbye, std::chrono::milliseconds now);

  /// Readable when serve() has something to do.
  [[nodiscard]] int descriptor() const { return poll_; }
  /// When tick() has something to do; nothing while nobody waits.
  [[nodiscard]] std::optional<std::chrono::milliseconds> next_deadline() const;
  /// Those who have not said HELLO.
  [[nodiscard]] std::size_t waiting() const { return waiting_.size(); }
  /// Those who were refused and may still be reading why.
  [[nodiscard]] std::size_t leaving() const { return leaving_.size(); }

 private:
  struct Peer;
  using Peers = std::list<Peer>;  ///< Limit: handshakes
  /// Those who wait, the oldest first, by the address of the other machine.
  using Crowd = std::list<Peer*>;  ///< Limit: handshakes_per_address
  using Crowds = std::map<std::string, Crowd, std::less<>>;
  struct Peer {
    Stranger stranger;
    std::unique_ptr<net::AcceptHandshake> handshake;  ///< null: leaving
    std::chrono::milliseconds deadline{};
    std::size_t discarded = 0;
    net::Interest armed;
    Peers::iterator self;
    std::optional<Crowds::iterator> crowd;  ///< while it waits; none: not counted by address
    Crowd::iterator in_crowd;
  };

  /// There is no place for another one: ends this peer's waiting, with a HELLO that came by now or
  /// without.
  void end_waiting(Peer& peer, const std::string& sentence, std::chrono::milliseconds now);
  void make_place_for(std::string_view address, std::chrono::milliseconds now);
  void join_crowd(Peer& peer, std::string_view address);
  void leave_crowd(Peer& peer);
  /// False: there is no place in the poll set.
  bool arm(Peer& peer, int operation);
  void read(Peer& peer, std::chrono::milliseconds now);
  void discard(Peer& peer);
  void begin_leaving(Peer& peer, std::chrono::milliseconds now);
  void judge(Peer& peer, std::chrono::milliseconds now);
  [[nodiscard]] std::optional<proto::Goodbye> refusal(Peer& peer) const;
  void turn_away(Peer& peer, const proto::Goodbye& goodbye, std::chrono::milliseconds now);
  /// Not while a batch of events is served: one of them may be for a peer that this removes.
  void keep_leaving_few();
  void remove(Peer& peer);

  const Limits& limits_;
  const Judge judge_;
  RefusalCounters& refusals_;
  int poll_;
  bool closing_ = false;
  Crowds crowds_;
  Peers waiting_;  ///< both in the order of their deadlines
  Peers leaving_;
};

}  // namespace gimnet::hub
