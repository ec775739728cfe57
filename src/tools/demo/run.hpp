#pragma once

#include <cstdint>
#include <string>

#include "tools/demo/options.hpp"

namespace gimnet::demo {

/// Exit codes of the demo.
enum class ExitCode : std::uint8_t { kGood = 0, kLost = 1, kUsage = 2, kNoNetwork = 3 };

/// Writes to standard output. False: it cannot be written, which standard error was told. A reader
/// that went away has enough, and is no failure.
[[nodiscard]] bool show(const std::string& text);

/// Runs the robot's process until it is told to end.
[[nodiscard]] ExitCode run_robot(const Options& options);

/// Runs the viewer's process, with an own hub and robot unless the role is kView; prints the
/// summary at the end.
[[nodiscard]] ExitCode run_viewer(const Options& options);

}  // namespace gimnet::demo
