#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "base/result.hpp"

namespace gimnet::demo {

/// The part of the demo that this process is.
enum class DemoRole : std::uint8_t { kAll, kRobot, kView };

/// The choice of characters.
enum class Glyphs : std::uint8_t { kAuto, kUtf8, kAscii };

/// The command line. Limits: `kSecondsMax`; speeds as in log_player.hpp.
struct DemoOptions {
  static constexpr double kSecondsMax = 86'400.0;

  DemoRole role = DemoRole::kAll;
  bool help = false;
  bool labs = false;  ///< two laboratories in place of one robot
  /// A log to play; empty: a simulated robot.
  std::string log;
  /// A hall for the simulated robot; empty: the built-in one.
  std::string map;
  double speed = 1.0;
  /// Ends by itself after so many seconds, and drives a course.
  std::optional<double> seconds;
  /// The hub to go to, in the roles robot and view; empty: GIMNET_HUB, or the hub's usual places.
  std::string hub_url;
  /// The robot's node name.
  std::string robot = "robot";
  Glyphs glyphs = Glyphs::kAuto;
};

/// Reads the arguments behind the program's name. Errors: unknown or repeated arguments, values
/// that are missing or out of range, and combinations that mean nothing; the sentence says what to
/// do.
[[nodiscard]] Result<DemoOptions> parse_options(std::span<const char* const> arguments);

/// The text of --help.
[[nodiscard]] std::string_view usage_text();

}  // namespace gimnet::demo
