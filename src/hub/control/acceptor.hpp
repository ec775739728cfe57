#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "hub/control/listener.hpp"
#include "hub/limits.hpp"
#include "hub/observe/refusal_counters.hpp"
#include "hub/transport/transport.hpp"

namespace gimnet::hub {

/// A connection that was accepted and has said nothing yet.
struct Stranger {
  std::unique_ptr<Transport> transport;
  PeerInfo peer;
  std::string identity;  ///< who it is, as far as the system tells: "uid 1000" over a Unix socket, "open" over TCP
  bool may_administer = false;  ///< root or the hub's own user, over a Unix socket
};

/// Takes connections from a listener. Out of descriptors it gives up a spare one to accept, tell `no_memory` and close,
/// so that peers learn at once what is wrong, and asks for a pause.
/// Thread safety: none. Ownership: of the listener and one spare descriptor.
class Acceptor {
 public:
  /// REQUIRES: limits and refusals outlive it.
  Acceptor(std::unique_ptr<Listener> listener, const Limits& limits, RefusalCounters& refusals);
  ~Acceptor();
  Acceptor(const Acceptor&) = delete;
  Acceptor& operator=(const Acceptor&) = delete;

  enum class After : std::uint8_t { wait, pause };
  /// Hands over what is waiting, at most a batch. `pause`: descriptors are short, come back after kPauseMs.
  After accept_some(const std::function<void(Stranger)>& take);
  static constexpr int kPauseMs = 100;

  [[nodiscard]] const Listener& listener() const { return *listener_; }

 private:
  [[nodiscard]] Stranger stranger(int descriptor) const;
  enum class Shortage : std::uint8_t { told_one, nobody_waits, nothing_helps };
  /// Descriptors are short: tells one peer with the spare one's help.
  Shortage turn_away();

  const std::unique_ptr<Listener> listener_;
  const Limits& limits_;
  RefusalCounters& refusals_;
  int spare_;
};

}  // namespace gimnet::hub
