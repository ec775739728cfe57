#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "gimnet/gimi/outcome.hpp"
#include "gimnet/gimi/records.hpp"
#include "gimnet/nif.h"

// What a hub knows, as records of the C++ API. Thread safety: pure functions of the handle.

namespace gimnet::gimi {

/// An empty pattern: everything.
[[nodiscard]] Outcome<std::vector<NodeRecord>> list_nodes(nif_node* node,
                                                          const std::string& pattern,
                                                          Timeout timeout);
[[nodiscard]] Outcome<std::vector<ServiceRecord>> list_services(nif_node* node,
                                                                const std::string& pattern,
                                                                Timeout timeout);
[[nodiscard]] Outcome<HubRecord> ask_hub(nif_node* node, Timeout timeout);
[[nodiscard]] Outcome<std::vector<ShardCounts>> ask_counters(nif_node* node, Timeout timeout);
/// All pages; `timeout` for them together.
[[nodiscard]] Outcome<std::vector<ConnectionRecord>> ask_connections(nif_node* node,
                                                                     Timeout timeout);

[[nodiscard]] Outcome<std::vector<RouteRecord>> ask_routes(nif_node* node, Timeout timeout);

// For administrators.
[[nodiscard]] Outcome<std::string> kick(nif_node* node, Peer peer, std::string_view reason,
                                        Timeout timeout);
[[nodiscard]] Outcome<void> reassign(nif_node* node, Peer peer, Peer new_id, Timeout timeout);
[[nodiscard]] Outcome<void> drain_hub(nif_node* node, Timeout timeout);
[[nodiscard]] Outcome<std::vector<HubChange>> reload_hub(nif_node* node, Timeout timeout);
[[nodiscard]] Outcome<std::string> set_hub_log_level(nif_node* node, std::string_view level,
                                                     Timeout timeout);

/// A record of the C API.
[[nodiscard]] NodeRecord record_of(const nif_node_record& found);
[[nodiscard]] ServiceRecord record_of(const nif_service_record& found);

}  // namespace gimnet::gimi
