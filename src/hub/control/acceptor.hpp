#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "hub/control/listener.hpp"
#include "hub/control/state/identity.hpp"
#include "hub/limits.hpp"
#include "hub/observe/request_counters.hpp"
#include "net/socket_stream.hpp"
#include "net/stream.hpp"
#include "proto/control/link.hpp"

namespace gimnet::hub {

/// Descriptors that are kept open for nothing: given up one by one when there are no others and an
/// administrator has to get in, and taken back, before anybody else gets them, when some are free
/// again. Thread safety: none. Ownership: of what it keeps. Limits: limits.administrators.
class DescriptorReserve {
 public:
  /// REQUIRES: limits outlives it.
  explicit DescriptorReserve(const Limits& limits);
  ~DescriptorReserve();
  DescriptorReserve(const DescriptorReserve&) = delete;
  DescriptorReserve& operator=(const DescriptorReserve&) = delete;

  /// Keeps as many as the limit says, as far as there are.
  void fill();
  /// One more descriptor is free. False: none is kept any more.
  [[nodiscard]] bool give_up_one();
  [[nodiscard]] std::size_t kept() const { return kept_.size(); }

 private:
  const Limits& limits_;
  std::vector<int> kept_;
};

/// A descriptor of no use, or -1 if there is none to be had.
[[nodiscard]] int open_spare_descriptor();

/// Writes the opening and GOODBYE to somebody who was not admitted. False: the peer takes nothing,
/// which nobody needs to be told. Never waits.
bool send_goodbye(net::Stream& transport, proto::GoodbyeCode code, std::string_view sentence);

/// The origin of a connection, as people read it.
struct PeerInfo {
  std::string transport;  ///< "tcp" or "unix"
  std::string address;    ///< "127.0.0.1:41234", or "pid 77 uid 1000"
};

/// A connection that was accepted and has said nothing yet.
struct Stranger {
  std::unique_ptr<net::Stream> transport;
  PeerInfo peer;
  Identity identity;
  Rights rights;
  bool on_reserve =
      false;  ///< has a descriptor that is kept for administrators: nobody else may stay
};

/// Takes connections from a listener. Out of descriptors it has a spare one to accept with. The
/// peer stays if others make room, or if it may administer the hub and there is a descriptor in
/// reserve for it; else it is told `no_memory` and closed, so that it learns at once what is wrong.
/// Thread safety: none. Ownership: of the listener and one spare descriptor.
class Acceptor {
 public:
  enum class Room : std::uint8_t {
    none,
    ordinary,  ///< a descriptor is free
    reserved,  ///< the same, and it is one of those that are kept for administrators
  };
  /// Ends somebody who has a descriptor and no right to it before this peer, if there is anybody.
  using MakeRoom = std::function<Room(const Stranger&)>;

  /// REQUIRES: limits, refusals and reserve outlive it.
  Acceptor(std::unique_ptr<Listener> listener, const Limits& limits, RefusalCounters& refusals,
           DescriptorReserve& reserve, MakeRoom make_room);
  ~Acceptor();
  Acceptor(const Acceptor&) = delete;
  Acceptor& operator=(const Acceptor&) = delete;

  enum class After : std::uint8_t { wait, pause };
  /// Hands over what is waiting, at most a batch. `pause`: descriptors are short, come back after
  /// kPauseMs.
  After accept_some(const std::function<void(Stranger)>& take);
  static constexpr int kPauseMs = 100;

  [[nodiscard]] const Listener& listener() const { return *listener_; }

 private:
  [[nodiscard]] std::unique_ptr<net::Stream> stream_of(int descriptor,
                                                       net::SocketStream::Family family) const;
  [[nodiscard]] Stranger stranger(int descriptor) const;
  enum class Shortage : std::uint8_t { served_one, nobody_waits, nothing_helps };
  /// Descriptors are short: takes one peer, or turns it away, with the spare one's help.
  Shortage accept_with_spare(const std::function<void(Stranger)>& take);
  /// Finds a descriptor for a peer that has the spare one. False: there is none for it.
  [[nodiscard]] bool find_room(Stranger& peer);
  void turn_away(const Stranger& peer);

  const std::unique_ptr<Listener> listener_;
  const Limits& limits_;
  RefusalCounters& refusals_;
  DescriptorReserve& reserve_;
  const MakeRoom make_room_;
  int spare_;
};

}  // namespace gimnet::hub
