#pragma once

#include <string>

#include "hub/shard/shard_state.hpp"

namespace gimnet::hub {

/// Ends connections and sessions of a shard. Thread safety: one shard.
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
  /// Loses the frames that the peer did not confirm. Each sender that asked for reports is told.
  /// `partial`: a frame that was written in part, or none.
  void lose_unconfirmed(Connection& connection, const Run& partial);
  /// Loses the frames that wait for the session and those that it did not confirm.
  void lose_all(Connection& connection);
  /// The session is over.
  void release(SessionRef session);

 private:
  [[nodiscard]] bool say_goodbye(Connection& connection, proto::GoodbyeCode code,
                                 const std::string& sentence);
  void detach(Connection& connection, bool said_goodbye);
  void count_lost_reports(Connection& connection);
  /// Drops the bytes that were read and not routed yet.
  void give_up_rest(Connection& connection);
  void tell(const Connection& connection, bool said_by_peer, proto::GoodbyeCode code,
            std::string sentence);

  ShardState& state_;
};

}  // namespace gimnet::hub
