#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tools/demo/monitor.hpp"
#include "tools/demo/node_port.hpp"

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
  /// Of the commands, those whose loss is as it should be.
  std::uint64_t commands_excused = 0;
};

/// Everything that went wrong, a sentence each; empty: nothing was lost but what is as it should
/// be. Messages are counted at both ends, drops by an own hub; a message `replaced` by a newer one
/// of its stream is not lost. Thread safety: pure functions.
[[nodiscard]] std::vector<std::string> complaints_about(const Monitor& monitor,
                                                        const RunRecord& run);

/// The figures of a run as a table, and the verdict.
[[nodiscard]] std::string summary_text(const Monitor& monitor, const RunRecord& run, bool utf8);

/// The facts about a run of `--labs`. A value type.
struct LabsRecord {
  /// A machine, and what its driver heard of it.
  struct Machine {
    std::string name;
    std::string kind;
    std::string hub;          ///< the one that it is connected to
    std::string driven_from;  ///< the hub of its driver
    Monitor monitor;
    RunRecord run;
  };
  struct Hub {
    std::string name;
    HubCounters counters;
  };
  std::vector<Machine> machines;
  std::vector<Hub> hubs;
  std::uint64_t pictures = 0;  ///< that the camera sent
  std::uint64_t picture_bytes = 0;
  std::vector<StreamRecord> seen;  ///< of them by each viewer, in order and whole
  std::uint64_t wan_bytes = 0;     ///< that crossed the WAN towards the viewers
  std::uint64_t cuts = 0;          ///< of the WAN
};

/// Everything that went wrong, a sentence each; empty: nothing was lost but what the cuts explain,
/// and the pictures crossed the WAN once. Cuts explain what was sent in one or soon after it, and
/// drops of frames that had no way. Thread safety: pure functions.
[[nodiscard]] std::vector<std::string> complaints_about(const LabsRecord& record);

/// The figures of the run as a table, and the verdict.
[[nodiscard]] std::string summary_text(const LabsRecord& record);

}  // namespace gimnet::demo
