#pragma once

#include <chrono>
#include <string>
#include <system_error>

namespace gimnet::hub {

/// How long a hub that starts waits for the end of a pipe that is its configuration: who writes it
/// may have to ask others, and who started the hub sees a hub that never comes.
inline constexpr std::chrono::milliseconds kPipePatience{10'000};

/// A whole file, or why it cannot be had.
struct ConfigText {
  std::string text;   ///< where it is longer, kConfigBytesMax + 1 bytes of it
  std::string error;  ///< what is wrong, and what to do
};

/// Reads a regular file, and /dev/null as an empty one. Folders, sockets and devices are errors,
/// and so is a pipe, unless it may be waited for: then it is read to its end, and one that has no
/// end by then, or is empty, is an error: a command that failed must not leave a hub with its
/// defaults. Never blocks for longer than that. Thread safety: any thread.
[[nodiscard]] ConfigText read_config_text(const std::string& path,
                                          std::chrono::milliseconds pipe_patience);

/// What to do about an error: `otherwise` where it is not that the process has no descriptor left.
[[nodiscard]] std::string remedy_of(const std::error_code& error, const std::string& otherwise);

}  // namespace gimnet::hub
