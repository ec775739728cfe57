#pragma once

#include <string>
#include <variant>

#include "tools/gimnet/exit_code.hpp"
#include "tools/gimnet/options.hpp"

namespace gimnet::tool {

/// The command line asked for nothing to run, or was wrong.
struct CommandEnding {
  ExitCode code = ExitCode::done;
  std::string text;  ///< for standard output with code `done`, else for standard error
};

/// Reads the command line. Errors: code `usage` and a sentence that names the argument and says
/// what to write.
[[nodiscard]] std::variant<ToolOptions, CommandEnding> parse_command_line(int argc,
                                                                          const char* const* argv);

}  // namespace gimnet::tool
