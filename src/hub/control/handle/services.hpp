#pragma once

#include "hub/control/handle/request.hpp"

// Requests about services and subscriptions: docs/protocol.md, section 8.

namespace gimnet::hub {

[[nodiscard]] proto::Payload handle_advertise(HandlerContext& context, const Request& request);
[[nodiscard]] proto::Payload handle_withdraw(HandlerContext& context, const Request& request);
[[nodiscard]] proto::Payload handle_services(HandlerContext& context, const Request& request);
[[nodiscard]] proto::Payload handle_subscribe(HandlerContext& context, const Request& request);
[[nodiscard]] proto::Payload handle_unsubscribe(HandlerContext& context, const Request& request);

}  // namespace gimnet::hub
