#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "gimnet/gimi.h"
#include "gimnet/gimi/conversions.hpp"
#include "gimnet/gimi/namespace.hpp"

// Lists, questions to hubs, and changes of them by administrators. Part of gimnet/gimi.hpp.

namespace gimnet::inline GIMNET_GIMI_NAMESPACE {

/// The part of a Node that lists what there is, and speaks with hubs as hubs. It is a template so
/// that a program compiles only those calls that it makes. Thread safety and errors: as Node's.
template <class Any>
class HubAccess {
 public:
  /// Nodes whose name matches (`*` one part, `**` any number; "": all, those without a name too),
  /// ascending ids. Errors of this and the others that list: bad_name (no pattern), timeout,
  /// not_connected, protocol.
  Outcome<std::vector<NodeRecord>> nodes(std::string_view pattern = {},
                                         Timeout timeout = Timeout{5000}) const {
    gimi_list list{};
    const gimi_status status =
        gimi_nodes(handle_, detail::c_text(pattern).c_str(), milliseconds_of(timeout), &list);
    return detail::listed<gimi_node_record>(status, list);
  }
  /// Services whose full name matches, ascending group ids.
  Outcome<std::vector<ServiceRecord>> services(std::string_view pattern = {},
                                               Timeout timeout = Timeout{5000}) const {
    gimi_list list{};
    const gimi_status status =
        gimi_services(handle_, detail::c_text(pattern).c_str(), milliseconds_of(timeout), &list);
    return detail::listed<gimi_service_record>(status, list);
  }

  /// Does what ping() does, and tells the way that the answer came.
  Outcome<TracedPing> trace(Peer to, Timeout timeout = Timeout{1000},
                            Lane lane = Lane::normal) const {
    TracedPing traced;
    gimi_list way{};
    const gimi_status status = gimi_trace(handle_, to.id, lane_number(lane),
                                          milliseconds_of(timeout), &traced.round_trip_ns, &way);
    if (status != GIMI_OK) return failure_of(status);
    traced.way_back = detail::records_of<gimi_trace_hop_record>(way);
    return traced;
  }

  // ---- hubs

  /// The hub itself, the counters of its io threads, its connections (ascending ids), the hubs that
  /// it knows (ascending ids), and its links to others (docs/operations.md). `hub_id` names another
  /// hub of the network; 0 is the own hub. Errors also: not_found (there is no way to that hub).
  Outcome<HubRecord> hub(Timeout timeout = Timeout{5000}, std::uint32_t hub_id = 0) const {
    gimi_list list{};
    const gimi_status status = gimi_hub(handle_, GIMI_HUB, hub_id, milliseconds_of(timeout), &list);
    auto records = detail::listed<gimi_hub_record>(status, list);
    if (!records) return records.failure();
    return std::move(records->front());
  }
  Outcome<std::vector<ShardCounts>> hub_counters(Timeout timeout = Timeout{5000},
                                                 std::uint32_t hub_id = 0) const {
    gimi_list list{};
    const gimi_status status =
        gimi_hub(handle_, GIMI_HUB_COUNTERS, hub_id, milliseconds_of(timeout), &list);
    if (status != GIMI_OK) return failure_of(status);
    return detail::counts_of(list);
  }
  Outcome<std::vector<ConnectionRecord>> hub_connections(Timeout timeout = Timeout{5000},
                                                         std::uint32_t hub_id = 0) const {
    gimi_list list{};
    const gimi_status status =
        gimi_hub(handle_, GIMI_HUB_CONNECTIONS, hub_id, milliseconds_of(timeout), &list);
    return detail::listed<gimi_connection_record>(status, list);
  }
  Outcome<std::vector<NetworkHub>> hubs(Timeout timeout = Timeout{5000},
                                        std::uint32_t hub_id = 0) const {
    gimi_list list{};
    const gimi_status status =
        gimi_hub(handle_, GIMI_HUB_NETWORK, hub_id, milliseconds_of(timeout), &list);
    return detail::listed<gimi_network_hub_record>(status, list);
  }
  Outcome<std::vector<LinkRecord>> hub_links(Timeout timeout = Timeout{5000},
                                             std::uint32_t hub_id = 0) const {
    gimi_list list{};
    const gimi_status status =
        gimi_hub(handle_, GIMI_HUB_LINKS, hub_id, milliseconds_of(timeout), &list);
    return detail::listed<gimi_link_record>(status, list);
  }
  /// The hub's own services, and those of other hubs of which subscribers at this hub missed
  /// messages: ServiceRecord::missed of each is about subscribers at this hub.
  Outcome<std::vector<ServiceRecord>> hub_missed(Timeout timeout = Timeout{5000},
                                                 std::uint32_t hub_id = 0) const {
    gimi_list list{};
    const gimi_status status =
        gimi_hub(handle_, GIMI_HUB_MISSED, hub_id, milliseconds_of(timeout), &list);
    return detail::listed<gimi_service_record>(status, list);
  }

  // ---- changing the hub, for those who joined as administrators; everybody else is denied

  /// Ends the session of a node, which is told `reason` (at most 256 bytes) and does not come back
  /// by itself; its token counts for nothing from then on. Answers with what the hub cannot promise
  /// (its disk is full, and it would forget that at a restart), as a rule nothing. Errors:
  /// not_found, denied, bad_argument (this node itself, a longer reason).
  Outcome<std::string> kick(Peer node, std::string_view reason = {},
                            Timeout timeout = Timeout{5000}) const {
    detail::Words words;
    const gimi_status status = gimi_kick(handle_, node.id, detail::c_text(reason).c_str(),
                                         milliseconds_of(timeout), words.text, sizeof words.text);
    return detail::text(status, words);
  }
  /// The node goes on under another id of its hub. Errors: not_found, taken, denied, bad_argument,
  /// limit (the hub cannot keep that over a restart: its disk is full).
  Outcome<void> reassign(Peer node, Peer new_id, Timeout timeout = Timeout{5000}) const {
    return detail::outcome_of(
        gimi_reassign(handle_, {node.id, new_id.id}, milliseconds_of(timeout)));
  }
  /// The hub writes what waits, says goodbye to everybody, and ends.
  Outcome<void> drain_hub(Timeout timeout = Timeout{5000}) const {
    return detail::outcome_of(gimi_drain_hub(handle_, milliseconds_of(timeout)));
  }
  /// The hub reads its configuration again. Errors: bad_argument (it is wrong, and nothing was
  /// changed), denied.
  Outcome<std::vector<HubChange>> reload_hub(Timeout timeout = Timeout{5000}) const {
    gimi_list list{};
    const gimi_status status = gimi_reload_hub(handle_, milliseconds_of(timeout), &list);
    return detail::listed<gimi_hub_change_record>(status, list);
  }
  /// The hub dials one link more, until it ends; an empty name is the URL, cost 0 is measured.
  /// `proxy`: the URL of an HTTP proxy to dial through; the password in it goes to the hub alone.
  /// Errors: bad_argument (no URL, a name that is there, another machine without `insecure`).
  Outcome<void> add_link(std::string_view url, std::string_view name = {}, std::uint16_t cost = 0,
                         std::string_view proxy = {}, Timeout timeout = Timeout{5000}) const {
    const std::string texts[] = {detail::c_text(url), detail::c_text(name), detail::c_text(proxy)};
    const gimi_link_options link{sizeof link, texts[0].c_str(), texts[1].c_str(), cost,
                                 0,           texts[2].c_str()};
    return detail::outcome_of(gimi_add_link(handle_, &link, milliseconds_of(timeout)));
  }
  /// Ends a link that the hub dials. Errors: not_found.
  Outcome<void> remove_link(std::string_view name, Timeout timeout = Timeout{5000}) const {
    return detail::outcome_of(
        gimi_remove_link(handle_, detail::c_text(name).c_str(), milliseconds_of(timeout)));
  }
  /// Fixes the cost of a link that the hub dials; 0: measured. Errors: not_found.
  Outcome<void> set_link_cost(std::string_view name, std::uint16_t cost,
                              Timeout timeout = Timeout{5000}) const {
    return detail::outcome_of(
        gimi_set_link_cost(handle_, detail::c_text(name).c_str(), cost, milliseconds_of(timeout)));
  }
  /// error, warning, info, debug or off. The level before. Errors: bad_argument, denied.
  Outcome<std::string> set_hub_log_level(std::string_view level,
                                         Timeout timeout = Timeout{5000}) const {
    detail::Words words;
    const gimi_status status =
        gimi_set_hub_log_level(handle_, detail::c_text(level).c_str(), milliseconds_of(timeout),
                               words.text, sizeof words.text);
    return detail::text(status, words);
  }

 protected:
  explicit HubAccess(gimi_handle handle) : handle_(handle) {}
  ~HubAccess() = default;

  gimi_handle handle_ = 0;  ///< of the node
};

}  // namespace gimnet::inline GIMNET_GIMI_NAMESPACE
