#pragma once

#include "hub/control/handle/request.hpp"

// HubCtrl requests that only read: docs/protocol.md, section 9.

namespace gimnet::hub {

[[nodiscard]] proto::Payload handle_hub_info(HandlerContext& context, const Request& request);
[[nodiscard]] proto::Payload handle_statistics(HandlerContext& context, const Request& request);
[[nodiscard]] proto::Payload handle_connections(HandlerContext& context, const Request& request);

}  // namespace gimnet::hub
