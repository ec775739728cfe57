#pragma once

#include <string_view>

#include "net/stream.hpp"
#include "proto/control/link.hpp"

namespace gimnet::hub {

/// Writes the opening and GOODBYE to somebody who was not admitted. False: the peer takes nothing,
/// which nobody needs to be told. Never waits.
bool send_goodbye(net::Stream& transport, proto::GoodbyeCode code, std::string_view sentence);

}  // namespace gimnet::hub
