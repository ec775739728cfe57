#pragma once

#include <cstddef>
#include <string>
#include <variant>
#include <vector>

#include "base/ids.hpp"
#include "base/log.hpp"
#include "hub/control/listen_url.hpp"
#include "hub/control/state/sessions.hpp"
#include "hub/limits.hpp"

namespace gimnet::hub {

/// How a hub is to run. Thread safety: immutable after start-up.
struct HubOptions {
  std::vector<ListenUrl> listen;  ///< empty: the default addresses
  std::size_t shards = 1;
  HubId id{1};
  std::string name;
  std::string state_dir;  ///< "": none
  Placement placement = Placement::spread;
  bool insecure = false;
  LogLevel log_level = LogLevel::info;
  Limits limits;
};

/// The command line asked for nothing to run, or was wrong.
struct CommandLineEnding {
  int exit_code = 0;
  std::string text;  ///< for standard output with exit code 0, else for standard error
};

inline constexpr std::size_t kShardCountMax = 16;

/// Reads tcphub's command line. Errors: exit code 2 and a sentence that names the argument and says what to write.
[[nodiscard]] std::variant<HubOptions, CommandLineEnding> parse_command_line(int argc, const char* const* argv);

/// Shards if the command line does not say: half of this machine's processors, since the nodes that a hub serves often
/// run beside it, at least 1 and at most 8.
[[nodiscard]] std::size_t default_shards();

}  // namespace gimnet::hub
