#pragma once

#include <cstddef>

#include "client/nif/group_moves.hpp"
#include "client/nif/outgoing.hpp"
#include "client/nif/pause_table.hpp"
#include "client/nif/send_queue.hpp"

namespace gimnet::nif {

/// Whether a frame of a message may enter the send queue: what holds a message that depends neither
/// on the connection nor on other messages. Thread safety: guarded by its owner.
class SendGate {
 public:
  /// They outlive it.
  SendGate(const PauseTable& pauses, const GroupMoves& moves, SendQueue& queue)
      : pauses_(pauses), moves_(moves), queue_(queue) {}

  /// Lets unconfirmed frames go to make room, where that is allowed.
  [[nodiscard]] bool lets_in(const Outgoing& message, std::size_t frame_size) {
    if (pauses_.is_paused(message.stream())) return false;
    if (message.is_group() && !moves_.settled()) return false;
    if (message.replaceable() &&
        queue_.would_replace(latest_stream_of(message.parts().header, message.parts().key))) {
      return true;
    }
    return queue_.has_room(frame_size);
  }
  /// The hub does not take the service of the message, as far as that is settled.
  [[nodiscard]] bool refuses(const Outgoing& message) const {
    return message.is_group() && moves_.settled() && moves_.refuses(message.parts().header.dst);
  }
  /// A message to a former group goes to the one that its service has now.
  void redirect(Outgoing& message) const { moves_.redirect(message); }

 private:
  const PauseTable& pauses_;
  const GroupMoves& moves_;
  SendQueue& queue_;
};

}  // namespace gimnet::nif
