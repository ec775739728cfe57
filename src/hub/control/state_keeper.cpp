#include "hub/control/state_keeper.hpp"

#include "base/log.hpp"

namespace gimnet::hub {
namespace {
using std::chrono::milliseconds;

/// The pause before another try if the state could not be kept.
constexpr milliseconds kAgainAfter{1'000};
}  // namespace

void StateKeeper::keep(Membership& membership, milliseconds now) {
  if (again_at_ && *again_at_ > now) return;
  static_cast<void>(keep_at_once(membership, now));
}

std::string StateKeeper::keep_at_once(Membership& membership, milliseconds now) {
  if (!keep_) return {};
  const Durable durable = membership.durable(now);
  HubState state = state_;
  state.node_mark = durable.nodes.mark;
  state.group_mark = durable.groups.mark;
  state.nodes_used = durable.nodes.used;
  state.kicked = durable.kicked;
  if (std::string error = keep_(state); !error.empty()) {
    log_error(error +
              "; the hub goes on, but soon gives no ids to newcomers, none by REASSIGN, and "
              "forgets at a restart whom it "
              "kicked");
    again_at_ = now + kAgainAfter;
    membership.state_not_kept();
    return error;
  }
  again_at_.reset();
  state_ = std::move(state);
  membership.state_kept(durable);
  return {};
}

}  // namespace gimnet::hub
