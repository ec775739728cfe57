#pragma once

#include <chrono>
#include <string>

#include "hub/control/state/membership.hpp"
#include "proto/control/ns.hpp"

// Nodes and services as listings and watches tell of them. Thread safety: pure functions.

namespace gimnet::hub {

/// The hub as its records name it.
struct HubTitle {
  HubId id{1};
  std::string name;
};

[[nodiscard]] proto::ns::NodeRecord record_of(const HubTitle& hub, const Session& session,
                                              const Services& services,
                                              std::chrono::milliseconds now);
/// Writes what subscribers are told of a service, but for the window in force for one of them.
void put_state(proto::ns::ServiceState& state, const HubTitle& hub, const Topic& topic,
               const Membership& membership);
/// REQUIRES: the topic is provided.
[[nodiscard]] proto::ns::ServiceRecord record_of(const HubTitle& hub, const Topic& topic);

}  // namespace gimnet::hub
