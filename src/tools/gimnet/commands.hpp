#pragma once

#include "tools/gimnet/exit_code.hpp"
#include "tools/gimnet/session.hpp"

// The commands, a file for each. They print data to the session's output and words to standard
// error.

namespace gimnet::tool {

[[nodiscard]] ExitCode run_send(Session& session);
[[nodiscard]] ExitCode run_recv(Session& session);
[[nodiscard]] ExitCode run_pub(Session& session);
[[nodiscard]] ExitCode run_echo(Session& session);
[[nodiscard]] ExitCode run_hz(Session& session);
[[nodiscard]] ExitCode run_bw(Session& session);
[[nodiscard]] ExitCode run_ping(Session& session);
[[nodiscard]] ExitCode run_nodes(Session& session);
[[nodiscard]] ExitCode run_services(Session& session);
[[nodiscard]] ExitCode run_watch(Session& session);
[[nodiscard]] ExitCode run_status(Session& session);
[[nodiscard]] ExitCode run_ctl(Session& session);

}  // namespace gimnet::tool
