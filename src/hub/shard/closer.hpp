#pragma once

#include <string>

#include "hub/shard/shard_state.hpp"

namespace gimnet::hub {

/// How connections and sessions of a shard end. Thread safety: one shard.
class Closer {
 public:
  explicit Closer(ShardState& state) : state_(state) {}

  /// Says GOODBYE, as far as the peer still listens, ends the connection, and tells the conductor.
  void close(Connection& connection, proto::GoodbyeCode code, std::string sentence);
  /// The peer's end, or an error, was read: nothing comes any more. In the middle of a frame that
  /// is counted.
  void on_end(Connection& connection);
  /// The connection is of no use any more. What the peer had sent need not have been read.
  void on_broken(Connection& connection);
  /// The peer said GOODBYE.
  void on_goodbye(Connection& connection, proto::GoodbyeCode code, std::string sentence);
  /// A newer connection of the same session is there: the old one is told `replaced`, the conductor
  /// knows.
  void fence(Connection& connection);
  /// What the connection's peer did not say that it took is lost, and each sender is told that
  /// asked for it. `partial`: a frame that was written in part, or none.
  void lose_unconfirmed(Connection& connection, const Run& partial);
  /// What waits for the session, and what it did not confirm, is lost.
  void lose_all(Connection& connection);
  /// The session is over.
  void release(SessionRef session);

 private:
  [[nodiscard]] bool say_goodbye(Connection& connection, proto::GoodbyeCode code,
                                 const std::string& sentence);
  void detach(Connection& connection, bool said_goodbye);
  /// What was read of it and not routed yet is not routed any more.
  void give_up_rest(Connection& connection);
  void tell(const Connection& connection, bool said_by_peer, proto::GoodbyeCode code,
            std::string sentence);

  ShardState& state_;
};

}  // namespace gimnet::hub
