#pragma once

#include "hub/control/handle/request.hpp"

// Requests about names of nodes: docs/protocol.md, section 8.

namespace gimnet::hub {

[[nodiscard]] proto::Payload handle_register(HandlerContext& context, const Request& request);
[[nodiscard]] proto::Payload handle_unregister(HandlerContext& context, const Request& request);
[[nodiscard]] proto::Payload handle_let_go(HandlerContext& context, const Request& request);
[[nodiscard]] proto::Payload handle_resolve(HandlerContext& context, const Request& request);
[[nodiscard]] proto::Payload handle_reverse(HandlerContext& context, const Request& request);
[[nodiscard]] proto::Payload handle_list(HandlerContext& context, const Request& request);

// Requests about watching names and services: docs/protocol.md, section 8.

[[nodiscard]] proto::Payload handle_watch(HandlerContext& context, const Request& request);
[[nodiscard]] proto::Payload handle_unwatch(HandlerContext& context, const Request& request);
[[nodiscard]] proto::Payload handle_watch_taken(HandlerContext& context, const Request& request);

}  // namespace gimnet::hub
