#pragma once

#include <cstdint>
#include <string>

#include "base/clock.hpp"
#include "client/nif/error.hpp"
#include "gimnet/nif.h"

namespace gimnet::nif {

/// Whether a node has a connection, and the answers of calls that want one.
/// Thread safety: guarded by its owner.
class ConnectionState {
 public:
  [[nodiscard]] bool connected() const { return state_ == State::connected; }
  /// There is none now, but another one may come.
  [[nodiscard]] bool away() const { return state_ == State::away; }
  /// None will come any more.
  [[nodiscard]] bool ended() const { return state_ == State::ended; }

  /// A connection stands. Nobody uses it if the state is ended().
  void connect() {
    if (!ended()) state_ = State::connected;
  }
  /// The connection broke.
  void lose();
  /// Calls answer with this failure from now on. NIF_CLOSED replaces an earlier one.
  void end(const Failure& failure);

  /// The answer of a call without a connection, with its sentence. REQUIRES: !connected().
  [[nodiscard]] nif_status not_connected() const;
  /// The answer of a call whose time is over before its message may go.
  [[nodiscard]] nif_status no_turn() const;

 private:
  enum class State : std::uint8_t { away, connected, ended };
  [[nodiscard]] std::string away_words() const;

  State state_ = State::away;
  Failure end_;                                   ///< of State::ended
  std::int64_t away_since_ns_ = steady_now_ns();  ///< of State::away
};

}  // namespace gimnet::nif
