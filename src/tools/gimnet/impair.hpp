#pragma once

#include <cstdint>
#include <string>

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

/// Relays until it is stopped by a signal; obeys the lines of standard input meanwhile, and answers
/// each with a line. Needs no hub. Thread safety: one thread.
[[nodiscard]] ExitCode run_impair(const ImpairOptions& options, StopSignal& stop);

}  // namespace gimnet::tool
