#pragma once

#include "hub/control/handle/request.hpp"
#include "proto/frame/frame_header.hpp"

namespace gimnet::hub {

/// The handler for an operation of that kind by somebody of that role. Never null: what is not in
/// the table is answered `not_supported`, what is for others `denied`. Thread safety: any thread.
[[nodiscard]] Handler handler_for(proto::Role role, proto::Kind kind, std::uint16_t operation);

/// The handler for what comes over a link from `asker`, a node of another hub or a hub itself:
/// requests that only read, and LET_GO of a hub. Others are answered `denied`.
[[nodiscard]] Handler handler_from_afar(NodeId asker, proto::Kind kind, std::uint16_t operation);

/// The answer to a request whose frame is not for this hub: `not_found`.
[[nodiscard]] proto::Payload handle_for_another(HandlerContext& context, const Request& request);

}  // namespace gimnet::hub
