#pragma once

#include "hub/control/handle/request.hpp"

// HubCtrl requests about the network of hubs: docs/protocol.md, section 9.

namespace gimnet::hub {

[[nodiscard]] proto::Payload handle_hubs(HandlerContext& context, const Request& request);
[[nodiscard]] proto::Payload handle_links(HandlerContext& context, const Request& request);

// For administrators only.
[[nodiscard]] proto::Payload handle_link_add(HandlerContext& context, const Request& request);
[[nodiscard]] proto::Payload handle_link_remove(HandlerContext& context, const Request& request);
[[nodiscard]] proto::Payload handle_link_cost(HandlerContext& context, const Request& request);

}  // namespace gimnet::hub
