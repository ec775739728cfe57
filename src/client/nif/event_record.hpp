#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "client/nif/storage.hpp"
#include "proto/control/ns.hpp"
#include "proto/frame/report.hpp"

// The events that the receive queue holds beside messages. Thread safety: pure functions.

namespace gimnet::nif {

/// A record that only says something happened. `text` is copied.
[[nodiscard]] Record* make_event(nif_incoming_type type, std::string text);
/// A NIF_REPORT of the hub `from`: what became of frames that this node sent.
[[nodiscard]] Record* make_report(const proto::Report& report, std::uint32_t from);
/// Its place in the receive queue; the reference goes with it.
[[nodiscard]] Item item_of(Record* record, std::size_t bytes);

/// Writes the state of a service into an event.
void put_service(nif_incoming& incoming, const proto::ns::ServiceState& state);

}  // namespace gimnet::nif
