#pragma once

#include "hub/shard/closer.hpp"
#include "hub/shard/connection_reader.hpp"
#include "hub/shard/flusher.hpp"
#include "hub/shard/shard_state.hpp"

namespace gimnet::hub {

/// Does a shard's work by the clock: keep-alive, silent and stalled peers, slow ones, messages that
/// waited too long. Time in which the shard itself stood still counts against nobody. Thread
/// safety: one shard.
class Keeper {
 public:
  Keeper(ShardState& state, Closer& closer, Flusher& flusher, ConnectionReader& reader)
      : state_(state), closer_(closer), flusher_(flusher), reader_(reader) {}

  /// Between two looks at all connections.
  static constexpr std::uint64_t kTickMs = 100;
  /// While memory is scarce, freed pages go back to the kernel so often.
  static constexpr std::uint64_t kReturnPagesMs = 10;
  /// Twice within the time for which a sender heeds PAUSE of another hub.
  static constexpr std::uint64_t kSayAgainMs = 500;

  /// Looks at all connections, if a tick has passed.
  void tick();
  /// When the next tick is, or Poller::kNever if there is nobody to look at.
  [[nodiscard]] std::uint64_t next_tick_at_ms() const;

  /// Nothing is read any more. Every connection ends once all shards drain and what waits for it
  /// was written, or at the deadline.
  void drain(std::uint64_t deadline_ms);
  /// After mail was taken: do all shards drain?
  void look_for_others();
  /// True once after drain(): the last connection ended, and no other shard has anything for one.
  [[nodiscard]] bool take_drained();

 private:
  void look_at(Connection& connection);
  void look_at_link(Connection& connection);
  void end_if_quiet(Connection& connection);
  /// Does nothing wait to be handed to the kernel?
  [[nodiscard]] static bool is_written(const Connection& connection);
  [[nodiscard]] std::uint64_t silent_ms(const Connection& connection) const;
  /// This shard did nothing for so long: what is asked of the peer within a time began as much
  /// later.
  void forgive(Connection& connection, std::uint64_t late_ms) const;
  /// Was nothing heard for silent_ms, nor is anything there to read? The connection may be closed
  /// by what is.
  [[nodiscard]] bool is_silent(Connection& connection);
  void say_ping(Connection& connection);
  /// Says one PING to a node that was not heard for half of silent_ms, whatever the hub sends:
  /// a library that is busy reading may say nothing by itself, but answers a PING.
  void ask_if_silent(Connection& connection);

  ShardState& state_;
  Closer& closer_;
  Flusher& flusher_;
  ConnectionReader& reader_;
  std::uint64_t return_pages_at_ms_ = 0;
  std::uint64_t next_tick_at_ms_ = 0;
  std::uint64_t say_again_at_ms_ = 0;
  std::uint64_t drain_deadline_ms_ = 0;
  bool draining_ = false;
  bool drained_told_ = false;
};

}  // namespace gimnet::hub
