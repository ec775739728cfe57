#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "base/log.hpp"
#include "hub/limits.hpp"

namespace gimnet::hub {

/// The result of reading the configuration again. A value type.
struct Reloading {
  /// A key whose value is another one now, as a configuration file has them.
  struct Change {
    std::string key;
    std::string from;
    std::string to;
    bool needs_restart = false;  ///< `from` stays in force
  };

  std::vector<std::string> faults;  ///< a line each; where there is one, nothing changes
  bool more_faults = false;         ///< there are others beside `faults`
  std::vector<Change> changes;
  Limits limits;  ///< to be in force: those that need a restart are as before
  LogLevel log_level = LogLevel::info;
};

/// Reads the configuration again, from where it came. Thread safety: the conductor's thread only.
using ReadAgain = std::function<Reloading()>;

/// Says in the log why the configuration was not taken.
void log_faults(const Reloading& reloading);

/// One line for the log: the keys that changed, and those that need a restart.
[[nodiscard]] std::string reload_summary(const Reloading& reloading);

/// Tells an administrator why a configuration was not taken: as many whole faults as `bytes_max`
/// have room for, a line each, and how many more there are and where. REQUIRES: there are faults;
/// bytes_max >= 256.
[[nodiscard]] std::string reload_refusal(const Reloading& reloading, std::size_t bytes_max);

}  // namespace gimnet::hub
