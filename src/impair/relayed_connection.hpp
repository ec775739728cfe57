#pragma once

#include <sys/socket.h>

#include <cstdint>

#include "base/descriptor.hpp"
#include "impair/delayed_channel.hpp"

namespace gimnet::impair {

/// A connection to the fault proxy, the one that it dialled for it, and what is between them.
/// Thread safety: the proxy's thread.
struct RelayedConnection {
  struct End {
    explicit End(int descriptor) : socket(descriptor) {}
    Descriptor socket;
    short ready = 0;  ///< what poll(2) said
  };
  /// One way: what is read at one end and written at the other.
  struct Flow {
    explicit Flow(std::uint64_t seed) : channel(seed) {}
    DelayedChannel channel;
    bool ended = false;       ///< its sender has ended, or was reset
    bool reset = false;       ///< it was reset: so is the reader, once it has what came before
    bool told = false;        ///< the reader was told of the end
    bool is_blocked = false;  ///< the reader's kernel takes nothing now
  };

  RelayedConnection(int accepted, int dialled, std::uint64_t seed)
      : client(accepted), target(dialled), up(seed), down(~seed) {}

  void end_by_reset() {
    const linger at_once{1, 0};
    for (const End* end : {&client, &target}) {
      static_cast<void>(
          ::setsockopt(end->socket.get(), SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once));
    }
    is_over = true;
  }

  End client;
  End target;
  bool is_connecting = true;
  bool is_over = false;
  Flow up;
  Flow down;
};

}  // namespace gimnet::impair
