#include "hub/control/state_keeper.hpp"

#include "base/log.hpp"

namespace gimnet::hub {
namespace {
using std::chrono::milliseconds;

/// How long after the state could not be kept it is tried again.
constexpr milliseconds kAgainAfter{1'000};
}  // namespace

void StateKeeper::keep(Membership& membership, milliseconds now) {
  if (!keep_ || (again_at_ && *again_at_ > now)) return;
  const Durable durable = membership.durable();
  HubState state = state_;
  state.node_mark = durable.node_mark;
  state.group_mark = durable.group_mark;
  state.kicked = durable.kicked;
  if (const std::string error = keep_(state); !error.empty()) {
    log_error(error + "; the hub goes on, but soon gives no ids to newcomers, and forgets at a restart whom it kicked");
    again_at_ = now + kAgainAfter;
    return;
  }
  again_at_.reset();
  state_ = std::move(state);
  membership.state_kept(durable);
}

}  // namespace gimnet::hub
