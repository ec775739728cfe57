#pragma once

#include "hub/shard/closer.hpp"
#include "hub/shard/shard_state.hpp"

namespace gimnet::hub {

/// Gives a session its connection: the first one, or the next after a break. Thread safety: one
/// shard.
class Attacher {
 public:
  Attacher(ShardState& state, Closer& closer) : state_(state), closer_(closer) {}

  void attach(AttachCommand command);
  /// The session goes on under another id, without what waits. REQUIRES: its connection is closed.
  void renumber(Connection& connection, NodeId node);

 private:
  [[nodiscard]] Connection& session_of(const AttachCommand& command);
  /// Fixes the counts of both directions; fills in what WELCOME says of them. Returns the gap to
  /// announce.
  [[nodiscard]] std::uint64_t settle_counts(Connection& connection, AttachCommand& command);
  /// False: the peer's count cannot be; `partial` is still there.
  [[nodiscard]] bool go_on(Connection& connection, const AttachCommand& command, Run& partial,
                           std::uint64_t& gap);
  [[nodiscard]] std::uint64_t resume_bytes(const Connection& connection) const;
  void begin_anew(Connection& connection, const AttachCommand& command, const Run& partial);
  void count_anew(Connection& connection);
  void welcome(Connection& connection, const proto::Welcome& welcome, std::uint64_t gap);
  /// Behind WELCOME, before all that waits: control frames go before a replay and before the lanes.
  void tell_again(Connection& connection, const AttachCommand& command);

  ShardState& state_;
  Closer& closer_;
};

}  // namespace gimnet::hub
