#pragma once

#include <string>
#include <string_view>

#include "impair/fault_proxy.hpp"

namespace gimnet::impair {

/// Does what a line asks of a running proxy, and gives the answer, a line without its end: "ok", of
/// `status` a JSON object, or "error: " and a sentence that names the word and what can be given.
///
///     delay 80ms   rate 1MB   jitter off ...   a setting, as change_setting() takes it
///     stall [up|down] [TIME]                   nothing gets through, for TIME or until `go`
///     go
///     cut                                      ends all connections as a reset does
///     refuse, accept                           closes new connections at once, or takes them again
///     status
///
/// Thread safety: any thread.
[[nodiscard]] std::string obey(FaultProxy& proxy, std::string_view line);

}  // namespace gimnet::impair
