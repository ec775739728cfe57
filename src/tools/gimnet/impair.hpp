#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "impair/fault_proxy.hpp"
#include "impair/impairment.hpp"
#include "tools/gimnet/exit_code.hpp"
#include "tools/gimnet/stop_signal.hpp"

namespace CLI {
class App;
}

namespace gimnet::tool {

/// The command line of `gimnet impair`. Thread safety: immutable once read.
struct ImpairOptions {
  std::string listen;
  std::string target;
  impair::Impairment how;
  std::uint64_t seed = 1;
};

/// Declares `impair`; `options` outlives the parsing.
void add_impair(CLI::App& app, ImpairOptions& options);

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
[[nodiscard]] std::string obey(impair::FaultProxy& proxy, std::string_view line);

/// Relays until it is stopped by a signal; obeys the lines of standard input meanwhile, and answers
/// each with a line. Needs no hub. Thread safety: one thread.
[[nodiscard]] ExitCode run_impair(const ImpairOptions& options, StopSignal& stop);

}  // namespace gimnet::tool
