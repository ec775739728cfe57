#pragma once

#include "hub/control/handle/request.hpp"

// HubCtrl requests that change the hub, for administrators only: docs/protocol.md, section 9.

namespace gimnet::hub {

[[nodiscard]] proto::Payload handle_kick(HandlerContext& context, const Request& request);
[[nodiscard]] proto::Payload handle_reassign(HandlerContext& context, const Request& request);
[[nodiscard]] proto::Payload handle_drain(HandlerContext& context, const Request& request);
[[nodiscard]] proto::Payload handle_reload(HandlerContext& context, const Request& request);
[[nodiscard]] proto::Payload handle_log_level(HandlerContext& context, const Request& request);

/// Answers `denied` with a sentence that explains how to become an administrator.
[[nodiscard]] proto::Payload handle_denied(HandlerContext& context, const Request& request);

}  // namespace gimnet::hub
