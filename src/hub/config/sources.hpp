#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "hub/config/settings.hpp"
#include "hub/config/toml_file.hpp"
#include "hub/config/value.hpp"
#include "hub/control/reloading.hpp"

namespace gimnet::hub {

/// Most files in a conf.d.
inline constexpr std::size_t kConfigFilesMax = 256;

/// The sources of a hub's configuration, the weakest first: defaults, a file, the files in conf.d
/// beside it, the environment, the flags. Kept so that all of it can be read again. A value type.
struct ConfigSources {
  std::string
      file;  ///< of --config or TCPHUB_CONFIG; "": the first of the default places that is there
  std::vector<Given> environment;  ///< TCPHUB_...
  std::vector<Given> flags;
  Faults faults{};      ///< of how the file is named
  std::string proxy{};  ///< --proxy or GIMNET_PROXY; "": none
};

/// The result of reading everything.
struct ReadConfiguration {
  Configuration configuration;  ///< whole only where there are no faults
  Faults faults;
  std::vector<std::string> files;  ///< that were read, the one beside conf.d first
  std::string file{};              ///< the one beside conf.d, to be read again; "": there is none
};

/// The places of the file if nobody says: the user's and the system's.
[[nodiscard]] std::vector<std::string> default_config_files();

/// The variables of this process that configure a hub; TCPHUB_CONFIG sets `sources.file` unless it
/// is set, and GIMNET_PROXY likewise `sources.proxy`. Warnings: variables that are no key.
[[nodiscard]] std::vector<std::string> read_environment(ConfigSources& sources,
                                                        const char* const* environment);

/// Reads everything. Errors are faults: a file that is named and not there, or cannot be read, or
/// is no regular file, is one. Thread safety: any thread. Limits: kConfigFilesMax files of
/// kConfigBytesMax each. Blocks no longer than the disk does.
[[nodiscard]] ReadConfiguration read_configuration(const ConfigSources& sources);

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
