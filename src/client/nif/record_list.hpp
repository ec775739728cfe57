#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "client/nif/storage.hpp"
#include "gimnet/nif.h"
#include "proto/control/ns.hpp"
#include "proto/frame/report.hpp"

namespace gimnet::nif {

/// Lists of the C API, with the memory that their records point into. nif_free_...() frees them.
[[nodiscard]] nif_node_list* make_node_list(std::vector<proto::ns::NodeRecord> records);
[[nodiscard]] nif_service_list* make_service_list(std::vector<proto::ns::ServiceRecord> records);

/// A record as C sees it. Valid until: the record changes.
[[nodiscard]] nif_node_record view_of(const proto::ns::NodeRecord& record);
[[nodiscard]] nif_service_record view_of(const proto::ns::ServiceRecord& record);

// The events that the receive queue holds beside messages. Thread safety: pure functions.

/// A record that only says something happened. `text` is copied.
[[nodiscard]] Record* make_event(nif_incoming_type type, std::string text);
/// A NIF_REPORT of the hub `from`: what became of frames that this node sent.
[[nodiscard]] Record* make_report(const proto::Report& report, std::uint32_t from);
/// A NIF_GAP of a message that is too large, which begins with `payload`. `begun`: its first
/// fragment, as a message. The first kBeginningMax bytes are copied: they hold its GIMI header.
inline constexpr std::size_t kBeginningMax = 64;
[[nodiscard]] Record* make_too_large(const nif_incoming& begun, std::span<const std::byte> payload);
/// Its place in the receive queue; the reference goes with it.
[[nodiscard]] Item item_of(Record* record, std::size_t bytes);

/// Writes the state of a service into an event.
void put_service(nif_incoming& incoming, const proto::ns::ServiceState& state);

}  // namespace gimnet::nif
