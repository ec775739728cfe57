#pragma once

#include <cstddef>
#include <cstdint>

#include "hub/shard/poller.hpp"

namespace gimnet::hub {

/// The reasons for which a connection is not read, as a set. Thread safety: a value type.
class ReadGate {
 public:
  enum Reason : std::uint8_t {
    held = 1,      ///< an outbox holds it: its sender did not heed PAUSE
    no_room = 2,   ///< a shard that it sends to has too much to do
    draining = 4,  ///< it closes once everything is written
    rest = 8,      ///< its last read was not routed whole
  };

  void shut(Reason reason) { reasons_ |= reason; }
  void clear(Reason reason) { reasons_ &= ~unsigned{reason}; }
  /// One of them; several are joined by `|`.
  [[nodiscard]] bool has(unsigned reasons) const { return (reasons_ & reasons) != 0; }
  [[nodiscard]] bool is_open() const { return reasons_ == 0; }

 private:
  unsigned reasons_ = 0;
};

/// A connection's transport as it takes bytes.
enum class WriteState : std::uint8_t {
  open,
  blocked,  ///< it took less than was offered: wait for it
  failed,   ///< nothing any more: read to its end, which tells that it broke
  gone,     ///< there is no transport
};

/// Does a connection get events? One that does not take them misses them until it is told again.
enum class EventState : std::uint8_t {
  told,
  missed,
  asked,  ///< its control queue is empty; the conductor was asked to tell it again
};

/// The readiness that the poller waits for. must_confirm: nothing more can be written before the
/// peer's CONFIRM, which may lie behind data for which it is held: two nodes that flood each other
/// would wait for ever. A rest is routed within the next turns, and is not worth a system call.
[[nodiscard]] inline Interest interest_of(ReadGate gate, WriteState write, bool must_confirm,
                                          std::size_t pending_out) {
  if (write == WriteState::gone) return {};
  const unsigned closed_by = must_confirm ? unsigned{ReadGate::no_room}
                                          : ReadGate::no_room | ReadGate::held | ReadGate::draining;
  return net::interest_of(!gate.has(closed_by), write == WriteState::blocked,
                          write == WriteState::failed ? 0 : pending_out);
}

}  // namespace gimnet::hub
