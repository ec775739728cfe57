#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tools/demo/monitor.hpp"

namespace gimnet::demo {

/// The facts about a run that the monitor does not know.
struct RunRecord {
  std::string hub_url;
  double seconds = 0.0;
  /// Commands that were sent.
  std::uint64_t commands = 0;
  /// Corners of the course that were reached.
  std::uint64_t corners = 0;
  /// The robot was told to finish, so its last totals are final.
  bool finished = false;
  /// Nobody else uses the hub: what it dropped was lost by this run.
  bool own_hub = true;
  /// The reason for which it ended before its time; "" if it did not.
  std::string broken;
};

/// Everything that went wrong, a sentence each; empty: nothing was lost. Messages are counted at
/// both ends, drops by an own hub; a message `replaced` by a newer one of its stream is not lost.
/// Thread safety: pure functions.
[[nodiscard]] std::vector<std::string> complaints_about(const Monitor& monitor,
                                                        const RunRecord& run);

/// The figures of a run as a table, and the verdict.
[[nodiscard]] std::string summary_text(const Monitor& monitor, const RunRecord& run, bool utf8);

}  // namespace gimnet::demo
