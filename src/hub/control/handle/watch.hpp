#pragma once

#include "hub/control/handle/request.hpp"

// Requests about watching names and services: docs/protocol.md, section 8.

namespace gimnet::hub {

[[nodiscard]] proto::Payload handle_watch(HandlerContext& context, const Request& request);
[[nodiscard]] proto::Payload handle_unwatch(HandlerContext& context, const Request& request);
[[nodiscard]] proto::Payload handle_watch_taken(HandlerContext& context, const Request& request);

}  // namespace gimnet::hub
