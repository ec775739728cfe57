#pragma once

#include <functional>
#include <optional>
#include <string>

#include "base/result.hpp"
#include "tools/demo/summary.hpp"
#include "tools/demo/terminal.hpp"

namespace gimnet::demo {

/// The options of the two laboratories.
struct LabsOptions {
  std::string programs;           ///< the folder of tcphub and gimnet-demo
  std::optional<double> seconds;  ///< ends after so long; else the user does
  Terminal* terminal = nullptr;   ///< the rover is driven here; null: by a course
  TerminalStyle style;
  std::function<void(const std::string&)> on_progress;  ///< may be empty
};

/// The demonstration of the paper: a hub in each of two laboratories, north and south, with a WAN
/// between, and one inside a robot in the north. Three machines: the rover, which carries its hub
/// and is driven on site; the crawler in the north, which is driven from the south; a simulator in
/// the south that offers the same services. A camera of the rover is watched by two viewers in the
/// south. The WAN is cut now and then, and comes back. Thread safety: the main thread only. Errors:
/// what could not be started, or ended by itself.
[[nodiscard]] Result<LabsRecord> run_labs(const LabsOptions& options);

}  // namespace gimnet::demo
