#pragma once

#include "hub/shard/closer.hpp"
#include "hub/shard/shard_state.hpp"

namespace gimnet::hub {

/// So much may wait unsent in the kernel on a connection of which nothing is known yet. A fast
/// connection does not become slower by it. On a slow one the first real-time message has little to
/// wait for.
inline constexpr std::uint32_t kFirstUnsentBytes = 64 * 1024;

/// Writes what the turn left in outboxes, once per connection, and looks after those that do not
/// take everything. Thread safety: one shard.
class Flusher {
 public:
  Flusher(ShardState& state, Closer& closer) : state_(state), closer_(closer) {
    spare_.reserve(kSpareMax);
  }

  /// All connections that have something to write. Returns whether some of them could have written
  /// more.
  bool flush_dirty();
  /// One connection, at once. It may be closed by it.
  void flush(Connection& connection);
  /// The connection's transport takes more again.
  void on_writable(Connection& connection);
  /// A connection that has waiting messages: is it too slow? Called each tick. May close it.
  void look_after(Connection& connection);

 private:
  void say_confirms();
  void ask_for_confirm(Connection& connection);
  void ask_to_be_told(Connection& connection);
  void let_wait(Connection& connection);
  /// Tells the node how many frames were dropped because its queue was full.
  void tell_losses(Connection& connection);
  void on_blocked(Connection& connection);
  /// Nothing more can be written. What the peer sent before it went is still read to its end.
  void on_write_failed(Connection& connection);
  /// From here on look_after() asks whether the connection gets on.
  void watch(Connection& connection);
  /// It has taken everything.
  void end_watch(Connection& connection);
  void on_emptied(Connection& connection);
  void adapt_to_rate(Connection& connection, std::uint64_t taken);

  /// Of connections that wait again and again, so many do not allocate for it.
  static constexpr std::size_t kSpareMax = 256;

  ShardState& state_;
  Closer& closer_;
  std::vector<Connection*> again_;  ///< used up their share of this turn
  std::vector<std::unique_ptr<Progress>>
      spare_;  ///< of connections that have got on. Limit: kSpareMax
};

}  // namespace gimnet::hub
