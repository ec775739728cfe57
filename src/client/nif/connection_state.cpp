#include "client/nif/connection_state.hpp"

namespace gimnet::nif {

void ConnectionState::lose() {
  if (!connected()) return;
  state_ = State::away;
  away_since_ns_ = steady_now_ns();
}

void ConnectionState::end(const Failure& failure) {
  if (ended() && failure.status != NIF_CLOSED) return;
  state_ = State::ended;
  end_ = failure;
}

std::string ConnectionState::away_words() const {
  const std::int64_t tenths = (steady_now_ns() - away_since_ns_) / 100'000'000;
  return "the hub has been away for " + std::to_string(tenths / 10) + "." +
         std::to_string(tenths % 10) + " s; the library dials again, so try again later";
}

nif_status ConnectionState::not_connected() const {
  if (ended()) return fail(end_);
  return fail(NIF_NOT_CONNECTED, away_words());
}

nif_status ConnectionState::no_turn() const {
  return fail(NIF_TIMEOUT, away() ? away_words() : std::string("no room within the time given"));
}

}  // namespace gimnet::nif
