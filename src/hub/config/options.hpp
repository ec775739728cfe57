#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "hub/config/settings.hpp"
#include "hub/config/sources.hpp"

namespace gimnet::hub {

/// The command line asked for nothing to run, or something is wrong.
struct CommandLineEnding {
  int exit_code = 0;
  std::string text;  ///< for standard output with exit code 0, else for standard error
};

/// A hub to be run.
struct CommandLine {
  Configuration configuration;
  ConfigSources sources;  ///< to read it again
  std::vector<std::string> files;
  std::vector<std::string> warnings;
};

/// Reads tcphub's command line, its environment and its configuration files. Errors: exit code 2
/// and a line for each thing that is wrong, which names it and says what to write.
[[nodiscard]] std::variant<CommandLine, CommandLineEnding> parse_command_line(
    int argc, const char* const* argv, const char* const* environment);

}  // namespace gimnet::hub
