#pragma once

#include "hub/control/handle/request.hpp"
#include "proto/frame/frame_header.hpp"

namespace gimnet::hub {

/// The handler for an operation of that kind by somebody of that role. Never null: what is not in
/// the table is answered `not_supported`, what is for others `denied`. Thread safety: any thread.
[[nodiscard]] Handler handler_for(proto::Role role, proto::Kind kind, std::uint16_t operation);

/// May it come over a link from a node of another hub? Requests that only read may.
[[nodiscard]] bool may_be_asked_from_afar(proto::Kind kind, std::uint16_t operation);
/// The answer to one that may not: `denied`.
[[nodiscard]] proto::Payload handle_denied_from_afar(HandlerContext& context,
                                                     const Request& request);

/// The answer to a request whose frame is not for this hub: `not_found`.
[[nodiscard]] proto::Payload handle_for_another(HandlerContext& context, const Request& request);

}  // namespace gimnet::hub
