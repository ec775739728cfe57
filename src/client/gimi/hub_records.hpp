#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "gimnet/gimi/outcome.hpp"
#include "gimnet/gimi/records.hpp"
#include "gimnet/nif.h"
#include "proto/control/ctrl_network.hpp"

// The knowledge of a hub, as records of the C++ API. Thread safety: pure functions of the handle.

namespace gimnet::gimi {

/// An empty pattern: everything.
[[nodiscard]] Outcome<std::vector<NodeRecord>> list_nodes(nif_node* node,
                                                          const std::string& pattern,
                                                          Timeout timeout);
/// `doing`: for the sentence of a failure.
[[nodiscard]] Outcome<std::vector<ServiceRecord>> list_services(
    nif_node* node, const std::string& pattern, Timeout timeout,
    const std::string& doing = "list the services");

/// A node of that name may be there soon, if it is not: its connection broke, its hub cannot be
/// reached, or names of other hubs may be on their way. Also where the hub did not say.
[[nodiscard]] bool may_come(nif_node* node, const std::string& name, Timeout timeout);

/// The node that asks, and the hub that is asked; 0: the own one.
struct Asking {
  nif_node* node = nullptr;
  std::uint32_t hub_id = 0;
};
[[nodiscard]] Outcome<HubRecord> ask_hub(Asking who, Timeout timeout);
[[nodiscard]] Outcome<std::vector<ShardCounts>> ask_counters(Asking who, Timeout timeout);
// All pages; `timeout` for them together.
[[nodiscard]] Outcome<std::vector<ConnectionRecord>> ask_connections(Asking who, Timeout timeout);
[[nodiscard]] Outcome<std::vector<NetworkHub>> ask_hubs(Asking who, Timeout timeout);
[[nodiscard]] Outcome<std::vector<LinkRecord>> ask_links(Asking who, Timeout timeout);
/// Services of which messages were missed there, and the hub's own.
[[nodiscard]] Outcome<std::vector<ServiceRecord>> ask_missed(Asking who, Timeout timeout);

// For administrators.
[[nodiscard]] Outcome<std::string> kick(nif_node* node, Peer peer, std::string_view reason,
                                        Timeout timeout);
[[nodiscard]] Outcome<void> reassign(nif_node* node, Peer peer, Peer new_id, Timeout timeout);
[[nodiscard]] Outcome<void> drain_hub(nif_node* node, Timeout timeout);
[[nodiscard]] Outcome<std::vector<HubChange>> reload_hub(nif_node* node, Timeout timeout);
[[nodiscard]] Outcome<std::string> set_hub_log_level(nif_node* node, std::string_view level,
                                                     Timeout timeout);
[[nodiscard]] Outcome<void> add_link(nif_node* node, const proto::ctrl::LinkAdd& link,
                                     Timeout timeout);
[[nodiscard]] Outcome<void> remove_link(nif_node* node, std::string_view name, Timeout timeout);
[[nodiscard]] Outcome<void> set_link_cost(nif_node* node, std::string_view name, std::uint16_t cost,
                                          Timeout timeout);

/// A record of the C API.
[[nodiscard]] NodeRecord record_of(const nif_node_record& found);
[[nodiscard]] ServiceRecord record_of(const nif_service_record& found);

}  // namespace gimnet::gimi
