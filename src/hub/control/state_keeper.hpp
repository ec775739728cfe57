#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>

#include "hub/control/state/hub_state.hpp"
#include "hub/control/state/membership.hpp"

namespace gimnet::hub {

/// Sees to it that what has to outlive the hub is kept where it does, and tries again where that
/// did not work. Thread safety: the conductor's thread only. Errors: go to the log; the hub goes on
/// within the ids that it has.
class StateKeeper {
 public:
  /// "" when the state is safe, or why it is not.
  using Keep = std::function<std::string(const HubState&)>;
  /// `state` was kept already. `keep` may be none: then nothing outlives the hub.
  StateKeeper(const HubState& state, Keep keep) : keep_(std::move(keep)), state_(state) {}

  /// Keeps what `membership` says now, and tells it so; nothing while it waits to try again.
  void keep(Membership& membership, std::chrono::milliseconds now);
  /// The same, also while it waits: for somebody who is told what came of it. Why it could not be
  /// kept, or "".
  [[nodiscard]] std::string keep_at_once(Membership& membership, std::chrono::milliseconds now);

  /// When to try again; nothing if all is kept.
  [[nodiscard]] std::optional<std::chrono::milliseconds> again_at() const { return again_at_; }
  /// As it was kept last.
  [[nodiscard]] const HubState& state() const { return state_; }

 private:
  const Keep keep_;
  HubState state_;
  std::optional<std::chrono::milliseconds> again_at_;  ///< it could not be kept
};

}  // namespace gimnet::hub
