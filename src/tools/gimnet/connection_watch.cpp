#include "tools/gimnet/connection_watch.hpp"

#include "tools/gimnet/session.hpp"

namespace gimnet::tool {

void ConnectionWatch::look() {
  const NodeState state = node_.state();
  if (!state.peer || state.ended) return;
  // It may have come back already.
  const bool broke = connected_ && (!state.connected || state.reconnects != reconnects_);
  if (broke) say("the connection broke (" + state.trouble + "); trying to connect again");
  if (state.connected && (broke || !connected_)) {
    // Why it was closed, the hub often tells only who is back.
    const bool knows_more = !broke && state.trouble != told_;
    say("connected again as " + state.peer.text() + (knows_more ? " (before: " + state.trouble + ")" : ""));
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
