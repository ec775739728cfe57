#pragma once

#include <string>
#include <vector>

#include "gimnet/gimi/outcome.hpp"
#include "gimnet/gimi/records.hpp"
#include "gimnet/nif.h"

// What a hub knows, as records of the C++ API. Thread safety: pure functions of the handle.

namespace gimnet::gimi {

/// An empty pattern: everything.
[[nodiscard]] Outcome<std::vector<NodeRecord>> list_nodes(nif_node* node, const std::string& pattern, Timeout timeout);
[[nodiscard]] Outcome<std::vector<ServiceRecord>> list_services(nif_node* node, const std::string& pattern,
                                                                Timeout timeout);
[[nodiscard]] Outcome<HubRecord> ask_hub(nif_node* node, Timeout timeout);
[[nodiscard]] Outcome<std::vector<ShardCounts>> ask_counters(nif_node* node, Timeout timeout);
/// All pages; `timeout` for each.
[[nodiscard]] Outcome<std::vector<ConnectionRecord>> ask_connections(nif_node* node, Timeout timeout);

}  // namespace gimnet::gimi
