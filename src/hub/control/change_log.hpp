#pragma once

#include "base/ids.hpp"
#include "hub/control/state/effects.hpp"
#include "hub/control/state/membership.hpp"

// The changes of nodes and services as lines of level debug: what somebody who watches everything
// is told, and who has another id. Costs nothing at other levels. Thread safety: the conductor's
// thread only.

namespace gimnet::hub {

/// REQUIRES: `membership` is as it was left by what led to the change.
void log_change(const NodeNoted& noted, const Membership& membership, HubId hub);
void log_change(const ServiceNoted& noted, const Membership& membership, HubId hub);
void log_change(const RenumberDue& due, const Membership& membership, HubId hub);

}  // namespace gimnet::hub
