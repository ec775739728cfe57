#pragma once

#include <cstddef>
#include <utility>

#include "hub/config/settings.hpp"
#include "hub/config/sources.hpp"
#include "hub/control/reloading.hpp"

namespace gimnet::hub {

/// Faults of the files that are told, and logged, at a reload: a hub that runs has more to do.
inline constexpr std::size_t kReloadFaultsMax = 100;

/// Knows where a running hub's configuration came from and what of it is in force. Thread safety:
/// one thread.
class Reloader {
 public:
  Reloader(ConfigSources sources, HubOptions in_force)
      : sources_(std::move(sources)), in_force_(std::move(in_force)) {}

  /// Reads everything again, for as long as the disk takes. With faults nothing changes. Without,
  /// what may change while a hub runs is in force from now on for the next comparison.
  [[nodiscard]] Reloading read_again();
  /// The log level was set by other means.
  void note_log_level(LogLevel level) { in_force_.log_level = level; }

 private:
  ConfigSources sources_;
  HubOptions in_force_;
};

}  // namespace gimnet::hub
