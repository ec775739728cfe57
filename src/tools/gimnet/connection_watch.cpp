#include "tools/gimnet/connection_watch.hpp"

#include <chrono>

#include "tools/gimnet/session.hpp"

namespace gimnet::tool {

void ConnectionWatch::look() { look("; trying to connect again"); }

void ConnectionWatch::look_at_end() { look(""); }

void ConnectionWatch::look_now_and_then(std::int64_t now_ns) {
  if (now_ns < next_look_ns_) return;
  next_look_ns_ = now_ns + std::chrono::nanoseconds(kPeriod).count();
  look();
}

void ConnectionWatch::look(const char* afterwards) {
  const NodeState state = node_.state();
  if (!state.peer || state.ended) return;
  // It may have come back already.
  const bool broke = connected_ && (!state.connected || state.reconnects != reconnects_);
  if (broke) say("the connection broke (" + state.trouble + ")" + afterwards);
  if (state.connected && (broke || !connected_)) {
    // Why it was closed, the hub often tells only who is back.
    const bool knows_more = !broke && state.trouble != told_;
    say("connected again as " + state.peer.text() +
        (knows_more ? " (before: " + state.trouble + ")" : ""));
  }
  if (broke) told_ = state.trouble;
  connected_ = state.connected;
  reconnects_ = state.reconnects;
}

bool ConnectionWatch::goes_on() {
  look();
  return !node_.state().ended;
}

}  // namespace gimnet::tool
