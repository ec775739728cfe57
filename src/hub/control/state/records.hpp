#pragma once

#include <chrono>
#include <string>

#include "hub/control/state/membership.hpp"
#include "hub/network/state/name_copies.hpp"
#include "proto/control/ns_watch.hpp"

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
/// `names`: where others may provide it; or none.
void put_state(proto::ns::ServiceState& state, const HubTitle& hub, const Topic& topic,
               const Membership& membership, const NameCopies* names = nullptr);
/// REQUIRES: the topic is provided.
[[nodiscard]] proto::ns::ServiceRecord record_of(const HubTitle& hub, const Topic& topic);

// The same of names of other hubs: of these their own hub alone knows the rest.

[[nodiscard]] proto::ns::NodeRecord node_record_of(const KnownName& known);
/// REQUIRES: it is a service.
[[nodiscard]] proto::ns::ServiceRecord service_record_of(const KnownName& known);
/// REQUIRES: it is a service.
void put_state(proto::ns::ServiceState& state, const KnownName& known);

[[nodiscard]] proto::ns::Change change_of(proto::ns::ChangeKind kind, const KnownName& known);
[[nodiscard]] proto::ns::Change change_of(const NameChange& noted, std::string_view hub_name);

}  // namespace gimnet::hub
